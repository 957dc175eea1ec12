"""kill -9 at random moments: the same command again, as often as it takes, ends with the result of an undisturbed run.

Each command is first run undisturbed, which says how long it takes. Then it is started again and again in another
folder and killed at moments drawn over that time, and at last left alone. ``CHAOSGYM_KILLS=20`` kills it more often.
"""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

ROOT = Path(__file__).parent.parent
MOMENTS = int(os.environ.get("CHAOSGYM_KILLS", "2"))
"""Kills of each command; each takes half a run of it."""

SWEEP = "impact-beam --axis excitation_frequency=10:30 --axis clearance=5e-5:2e-4 --sobol 1200 --seed 2 --budget 100"
BEAM = "chaosgym/ImpactBeamTolerance-v1"
TRAIN = f"--env {BEAM} --steps 7680 --envs 32 --rollout 60 --batch 240 --every 1920"
COMPARE = ("compare", BEAM, "--machines", "8", "--only", "follow the demand", "--only", "back off")
CROSSES = (
    "impact-beam --axis damping_ratio=0.01:0.05:log --axis excitation_frequency=18:30 "
    "--axis clearance=1e-4:1.4e-4:log --crosses 60 --seed 3 --budget 100 --signals 1"
)


def _sweep(out):
    return f"-m chaosgym sweep {SWEEP} --out {out}"


def _rows(out):
    return pq.read_table(out / "sweep.parquet").to_pylist()


def _training(out):
    return f"{ROOT / 'agents' / 'ppo.py'} {TRAIN} --out {out}"


def _policy(out):
    rows = [line.rpartition(",")[0] for line in (out / "progress.csv").read_text().splitlines()]
    return [(out / name).read_bytes() for name in ("policy.json", "weights.npz")], rows


def _calibration(out):
    """With a cache of its own, so that kills meet the thorough runs too, not only the search."""
    words = ["thesis", "calibrate", *f"impact-beam --budget 4 --workers 1 --out {out}/search".split()]
    program = (
        f"import os, sys, chaosgym; os.environ['XDG_CACHE_HOME'] = '{out}/cache'; sys.argv = {words};"
        "from thesis.cli import main; main()"
    )
    return ["-c", program]


def _constants(out):
    return [(out / "search" / name).read_text() for name in ("journal.jsonl", "result.json")]


def _comparison(out):
    return ["-m", "chaosgym", *COMPARE, "--out", str(out / "jobs.parquet")]


def _jobs(out):
    return pq.read_table(out / "jobs.parquet").to_pylist()


def _pipeline(out):
    program = (
        "import sys; from subprocess import run; c = [sys.executable, '-m', 'chaosgym'];"
        f"run([*c, 'sweep', *'{CROSSES}'.split(), '--out', '{out}/data'], check=True);"
        f"run([*c, 'dataset', 'card', '{out}/data'], check=True)"
    )
    return ["-c", program]


def _dataset(out):
    card = (out / "data" / "CARD.md").read_text().replace(str(out), "OUT")
    return pq.read_table(out / "data" / "sweep.parquet").to_pylist(), card


WORK = {
    "a sweep": (_sweep, _rows),
    "training": (_training, _policy),
    "a calibration": (_calibration, _constants),
    "an evaluation": (_comparison, _jobs),
    "a dataset with its card": (_pipeline, _dataset),
}


def _start(command, folder):
    """The command in a process group of its own, which a kill ends whole."""
    folder.mkdir(exist_ok=True)
    given = command(folder)
    words = given if isinstance(given, list) else given.split()
    with (folder.parent / "log").open("ab") as log:
        return subprocess.Popen([sys.executable, *words], cwd=ROOT, stdout=log, stderr=log, start_new_session=True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", WORK)
def test_a_killed_command_ends_as_an_undisturbed_one(kind, tmp_path):
    """Rows, weights, constants, scores and pages are equal to the last digit, whenever the kills came."""
    command, result = WORK[kind]
    assert _start(command, tmp_path / "warm").wait() == 0, (tmp_path / "log").read_text()[-2000:]
    began = time.monotonic()
    assert _start(command, tmp_path / "undisturbed").wait() == 0
    duration = time.monotonic() - began
    moments, killed = random.Random(kind), 0
    for _ in range(MOMENTS):
        process = _start(command, tmp_path / "killed")
        try:
            process.wait(moments.uniform(0.0, duration))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            killed += process.wait() == -signal.SIGKILL
        else:
            assert process.returncode == 0, (tmp_path / "log").read_text()[-2000:]
    assert killed > 0
    assert _start(command, tmp_path / "killed").wait() == 0, (tmp_path / "log").read_text()[-2000:]
    assert result(tmp_path / "killed") == result(tmp_path / "undisturbed")
