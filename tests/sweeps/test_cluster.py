"""A sweep on a Dask cluster: a real scheduler and two worker processes on loopback."""

import json
import subprocess
import sys
import time

import pytest

from chaosgym.machines import ImpactBeam
from chaosgym.sweeps import Axis, SweepPlan, read_sweep, run_sweep
from tests.cli.run import run

POINTS = 1100
COMMAND = (
    sys.executable,
    "-m",
    "chaosgym",
    "sweep",
    "impact-beam",
    "--fidelity",
    "standard",
    "--axis",
    "excitation_frequency=10:30",
    "--axis",
    "clearance=5e-5:2e-4",
    "--sampling",
    f"random:{POINTS}:4",
    "--budget",
    "100",
)


def start(log, *arguments):
    """Start a process in a folder of its own, in which its output goes to a file."""
    log.parent.mkdir(exist_ok=True)
    with log.open("w") as output:
        return subprocess.Popen(
            [sys.executable, "-m", *arguments], stdout=output, stderr=subprocess.STDOUT, cwd=log.parent
        )


def wait_until(condition, seconds=120.0):
    """Wait, and say so if it was in vain."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)


@pytest.fixture
def cluster(tmp_path):
    """Address of a scheduler, and its two workers."""
    file = tmp_path / "scheduler.json"
    scheduler = start(
        tmp_path / "scheduler" / "log",
        "distributed.cli.dask_scheduler",
        "--host",
        "127.0.0.1",
        "--port",
        "0",
        "--no-dashboard",
        "--scheduler-file",
        str(file),
    )
    wait_until(file.exists)
    address = json.loads(file.read_text())["address"]
    workers = [
        start(
            tmp_path / f"worker-{number}" / "log",
            "distributed.cli.dask_worker",
            address,
            "--nthreads",
            "1",
            "--no-nanny",
            "--no-dashboard",
            "--local-directory",
            "scratch",
        )
        for number in range(2)
    ]
    wait_until(lambda: scheduler_workers(address) == 2)
    yield address, workers, scheduler
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


def scheduler_workers(address):
    """How many workers a scheduler has."""
    script = f"from distributed import Client\nwith Client({address!r}) as c: print(len(c.scheduler_info()['workers']))"
    asked = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return int(asked.stdout)


@pytest.mark.slow
def test_rows_of_a_cluster_that_loses_a_worker_are_those_of_one_process(cluster, tmp_path):
    """One of two workers is killed half way: nothing is lost, nothing twice, and every row is the local run's."""
    address, workers, _ = cluster
    command = subprocess.Popen(
        [*COMMAND, "--workers", address, "--out", str(tmp_path / "c")], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    wait_until(lambda: list(tmp_path.glob("c/chunks/0*.parquet")), 400.0)
    workers[0].kill()
    _, errors = command.communicate(timeout=600)
    assert command.returncode == 0, errors.decode()
    axes = (Axis("excitation_frequency", 10.0, 30.0), Axis("clearance", 5e-5, 2e-4))
    local = run_sweep(SweepPlan(ImpactBeam(), axes, "random", POINTS, 4, budget=100), tmp_path / "l")
    assert read_sweep(tmp_path / "c").table.equals(local.table)
    assert len(local.table) == POINTS


def test_a_missing_scheduler_is_one_line(tmp_path, monkeypatch):
    """Nobody listens at port 1: exit code 2, the address is named, and the folder can be used without a cluster."""
    monkeypatch.setattr("chaosgym.sweeps.run.CONNECT_SECONDS", 0.5)
    code, out, err = run(*COMMAND[3:], "--workers", "tcp://127.0.0.1:1", "--out", tmp_path / "c")
    assert (code, out) == (2, "")
    told = err.splitlines()
    assert told[-1].startswith("Error: no Dask scheduler answers at tcp://127.0.0.1:1: ")
    assert "Traceback" not in err
    assert not (tmp_path / "c").exists()


@pytest.mark.slow
def test_a_dead_scheduler_is_one_line(cluster, tmp_path):
    """Killed while its workers compute: exit code 1, one line beside the progress, the plan stays."""
    address, _, scheduler = cluster
    command = subprocess.Popen(
        [*COMMAND, "--workers", address, "--out", str(tmp_path / "c")], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    wait_until((tmp_path / "c" / "chunks").is_dir)
    time.sleep(1.0)
    scheduler.kill()
    _, errors = command.communicate(timeout=120)
    told = [line for line in errors.decode().replace("\r", "\n").split("\n") if line and not line.startswith("sweep:")]
    assert command.returncode == 1
    assert len(told) == 1, "\n".join(told[-16:])
    assert "gave up" in told[0]
    assert "run the same command again" in told[0]
    assert (tmp_path / "c" / "plan.json").is_file()
