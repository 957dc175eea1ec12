"""kill -9 and SIGTERM at random moments: the same command again ends with the result of an undisturbed run.

Each command is first run undisturbed, which says how long it works after its first sign of progress. Then it is started
again in another folder and killed at a moment drawn over that time, one time in three by SIGTERM; where it ends first,
the next start is in a new folder. Every run of the test draws another moment. ``CHAOSGYM_KILLS=30`` kills 30 times.
"""

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from chaosgym.control.policies import load_policy
from chaosgym.control.rollout import play

ROOT = Path(__file__).parent.parent
MOMENTS = int(os.environ.get("CHAOSGYM_KILLS", "1"))
"""Kills of each command; each takes a start and half of the work after it."""

SWEEP = "impact-beam --axis excitation_frequency=10:30 --axis clearance=5e-5:2e-4 --sampling sobol:400:2 --budget 100"
BEAM = "chaosgym/ImpactBeamTolerance-v1"
TRAIN = f"--env {BEAM} --steps 5760 --envs 32 --rollout 60 --batch 240 --every 1920"
COMPARE = ("compare", BEAM, "--machines", "8", "--only", "follow the demand", "--only", "back off")
CROSSES = (
    "impact-beam --axis damping_ratio=0.01:0.05:log --axis excitation_frequency=18:30 "
    "--axis clearance=1e-4:1.4e-4:log --sampling crosses:30:3 --budget 100 --label signals=1"
)


SMALL = "--envs 16 --rollout 60 --batch 240 --every 960"
SCRIPTS = {
    "ppo": f"{TRAIN} --memory",
    "recurrent_ppo": f"--env {BEAM} --steps 960 --envs 4 --rollout 30 --batch 60 --every 120 --epochs 3 --units 16",
    "constrained_ppo": f"--env {BEAM} --steps 2880 {SMALL}",
    "sac": f"--env {BEAM} --steps 1600 --envs 8 --every 400 --gradient-steps 1",
    "learn_map": f"--env {BEAM} --steps 1920 --envs 4 --epochs 3 --units 16",
}
LEARNED = (
    "impact-beam --axis excitation_frequency=4:30:log --axis clearance=2e-5:2e-4:log --sampling sobol:120:5 "
    "--budget 200 --label signals=1"
)
"""Sweep from which the classifier learns; made once, beside the folders of the runs."""
BRIEF = """machine = "impact-beam"
series = 8
[parameters]
excitation_frequency = "8 Hz"
[tolerances]
excitation_frequency = "2 %"
clearance = "5 %"
[criteria]
load_rating = "300 N"
life = "2000 Mcycles"
reliability = 0.999
[changes]
clearance = ["0.0635 mm"]
"""


def _sweep(out):
    return f"-m chaosgym sweep {SWEEP} --out {out}"


def _rows(out):
    return pq.read_table(out / "sweep.parquet").to_pylist()


def _training(script):
    return lambda out: f"{ROOT / 'agents' / script}.py {SCRIPTS[script]} --out {out}"


def _policy(out):
    rows = [line.rpartition(",")[0] for line in (out / "progress.csv").read_text().splitlines()]
    return [(out / name).read_bytes() for name in ("policy.json", "weights.npz")], rows


def _agent(out):
    """The same of a training whose last row is of whole jobs, and whose policy plays one without torch."""
    last = list(csv.DictReader((out / "progress.csv").read_text().splitlines()))[-1]
    assert float(last["return"]) < 0.0 <= float(last["type_iii"]) <= 1.0
    assert play(load_policy(out), BEAM, range(1)).returns.max() < 0.0
    return _policy(out)


def _calibration(out):
    """With a cache of results of its own, so that kills meet thorough runs too: those at single speeds."""
    words = ["thesis", "calibrate", *f"impact-beam --budget 2 --workers 1 --out {out}/search".split()]
    program = (
        f"import os, sys, chaosgym.core.kernel_cache; os.environ['XDG_CACHE_HOME'] = '{out}/cache'; sys.argv = {words};"
        "from thesis.scorecard import calibrate; every = calibrate.statements_of;"
        "calibrate.statements_of = lambda *of: [one for one in every(*of) if one.along is None];"
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
        f"run([*c, 'dataset', 'map', '{out}/data', '--out', '{out}/map.png'], check=True)"
    )
    return ["-c", program]


def _dataset(out):
    return pq.read_table(out / "data" / "sweep.parquet").to_pylist(), (out / "map.png").read_bytes()


def _commands(*commands, unless):
    """Program that runs one command line after another, and nothing once a file is there."""
    return [
        "-c",
        f"import os, sys; from subprocess import run; os.path.exists({str(unless)!r}) or "
        f"[run([sys.executable, *words], check=True) for words in {list(commands)!r}]",
    ]


def _classifier(out):
    data = out.parent / "data"
    if not data.exists():
        subprocess.run([sys.executable, "-m", "chaosgym", "sweep", *LEARNED.split(), "--out", str(data)], check=True)
    train = ["-m", "chaosgym", "train-classifier", "--data", str(data), "--out", f"{out}/learned"]
    return _commands(train, unless=out / "learned")


def _learned(out):
    report = json.loads((out / "learned" / "report.json").read_text())
    del report["training_seconds"]
    return report, [(out / "learned" / name).read_bytes() for name in ("CARD.md", "classifier.npz")]


def _design(out):
    (out / "brief.toml").write_text(BRIEF)
    return f"-m chaosgym design {out}/brief.toml --out {out}/report.html --overwrite"


def _report(out):
    """JSON and page, which name the file of the brief."""
    answer, page = ((out / name).read_text().replace(str(out), "OUT") for name in ("report.json", "report.html"))
    return json.loads(answer), page


def _minari(out):
    name = out / "minari" / "chaosgym" / "ImpactBeamTolerance" / "random-v1"
    return _commands([str(ROOT / "agents" / "export_minari.py"), "--jobs", "20", "--out", f"{out}/minari"], unless=name)


def _jobs_of_minari(out):
    program = (
        "import hashlib, minari; h = hashlib.sha256()\n"
        "for e in minari.load_dataset('chaosgym/ImpactBeamTolerance/random-v1'):\n"
        "    [h.update(a.tobytes()) for a in (e.observations, e.actions, e.rewards, e.terminations)]\n"
        "print(h.hexdigest())"
    )
    where = {**os.environ, "MINARI_DATASETS_PATH": str(out / "minari")}
    return subprocess.run([sys.executable, "-c", program], env=where, check=True, capture_output=True, text=True).stdout


WORK = {
    "a sweep": (_sweep, _rows),
    "training": (_training("ppo"), _agent),
    "training of recurrent PPO": (_training("recurrent_ppo"), _agent),
    "training under a constraint": (_training("constrained_ppo"), _agent),
    "training of SAC": (_training("sac"), _agent),
    "a learned map": (_training("learn_map"), _policy),
    "a classifier": (_classifier, _learned),
    "a design": (_design, _report),
    "a dataset of Minari": (_minari, _jobs_of_minari),
    "a calibration": (_calibration, _constants),
    "an evaluation": (_comparison, _jobs),
    "a dataset with its map": (_pipeline, _dataset),
}


def _start(command, folder):
    """The command in a process group of its own, which a kill ends whole; what it says goes into a file beside."""
    folder.mkdir(exist_ok=True)
    given = command(folder)
    words = given if isinstance(given, list) else given.split()
    log = folder.parent / "log"
    with log.open("wb") as said:
        return subprocess.Popen([sys.executable, *words], cwd=ROOT, stdout=said, stderr=said, start_new_session=True)


def _working(process, log):
    """Wait for the first bar of progress; tell whether the process still runs."""
    while process.poll() is None and b"%|" not in log.read_bytes():
        time.sleep(0.01)
    return process.poll() is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", WORK)
def test_a_killed_command_ends_as_an_undisturbed_one(kind, tmp_path):
    """Rows, weights, constants, scores and pages are equal to the last digit, whenever the kills came.

    Every kill meets a process at work: where the command ended first, its result is compared and it starts anew.
    """
    (command, result), log = WORK[kind], tmp_path / "log"
    undisturbed = _start(command, tmp_path / "undisturbed")
    assert _working(undisturbed, log), "no sign of progress"
    began = time.monotonic()
    assert undisturbed.wait() == 0, log.read_text()[-2000:]
    duration = time.monotonic() - began
    expected = result(tmp_path / "undisturbed")
    draw, killed, rounds = random.Random(), 0, 0
    while killed < MOMENTS:
        process = _start(command, tmp_path / f"killed-{rounds}")
        if _working(process, log):
            moment, how = draw.uniform(0.0, duration), draw.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM])
            try:
                process.wait(moment)
            except subprocess.TimeoutExpired:
                print(f"{how.name} after {moment:.2f} s")  # what a failed test shows
                os.killpg(process.pid, how)
                if process.wait() == -how:
                    killed += 1
                    continue
        assert process.returncode == 0, log.read_text()[-2000:]
        assert result(tmp_path / f"killed-{rounds}") == expected
        rounds += 1
    print(f"{kind}: ended {killed} times within {duration:.0f} s of work, in {rounds + 1} runs")
    assert _start(command, tmp_path / f"killed-{rounds}").wait() == 0, log.read_text()[-2000:]
    assert result(tmp_path / f"killed-{rounds}") == expected
