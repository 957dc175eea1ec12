"""The comparison runs from the command line, goes on where it was stopped, and says what is wrong."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from chaosgym.control.policies.shipped import shipped_folder

NOMINAL = "chaosgym/ImpactBeam-v0"
SCRIPT = Path(__file__).parent.parent.parent / "agents" / "evaluate.py"


def _run(*arguments):
    command = [sys.executable, str(SCRIPT), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_controllers_are_compared_and_the_comparison_goes_on(tmp_path):
    """Report, table and figure are written; jobs that are kept are not run again, and contenders can be added."""
    out = ["--out", str(tmp_path / "comparison"), "--machines", "2"]
    first = _run(*out, "--controllers", "lowest")
    assert first.returncode == 0, first.stderr
    assert "| lowest | nothing | 1 |" in first.stdout
    folder = tmp_path / "comparison"
    assert (folder / "comparison.png").read_bytes().startswith(b"\x89PNG")
    kept = (folder / "jobs" / "lowest-0.json").stat().st_mtime_ns
    second = _run(*out, "--controllers", "highest", "--json")
    report = json.loads(second.stdout)
    assert set(report["contenders"]) == {"lowest", "highest", "safe constant", "dynamic programming"}
    assert report["contenders"]["lowest"]["score"] < 0.0
    assert report["contenders"]["dynamic programming"]["score"] == pytest.approx(1.0)
    assert report == json.loads((folder / "report.json").read_text())
    assert (folder / "jobs" / "lowest-0.json").stat().st_mtime_ns == kept
    other = _run("--out", str(folder), "--machines", "3", "--controllers", "lowest")
    assert other.returncode != 0
    assert "holds another comparison" in other.stderr


def test_a_contender_that_was_stopped_goes_on_with_its_next_job(tmp_path):
    """The rest of the jobs is as if nothing had happened, even by chance; who is not asked for waits and is named."""
    out = ["--out", str(tmp_path), "--machines", "3"]
    assert _run(*out, "--controllers", "random").returncode == 0
    path = tmp_path / "jobs" / "random-0.json"
    whole = path.read_text()
    content = json.loads(whole)
    path.write_text(json.dumps(content | {"jobs": content["jobs"][:1]}))
    waiting = _run(*out, "--controllers")
    assert "1 of 3 jobs; ask for random to go on" in waiting.stderr
    assert "| random |" not in waiting.stdout
    assert "| random |" in _run(*out, "--controllers", "random").stdout
    assert path.read_text() == whole


def test_jobs_belong_to_a_policy_and_not_to_its_place(tmp_path):
    """A folder whose policy has changed is not given the jobs of the one before, and run-10 comes after run-9."""
    for seed in (9, 10):
        shutil.copytree(shipped_folder(NOMINAL), tmp_path / f"run-{seed}")
    arguments = ("--env", NOMINAL, "--repeats", "1", "--out", str(tmp_path / "out"), "--controllers")
    asked = (*arguments, "--policy", f"PPO={tmp_path}/run-*")
    assert _run(*asked).returncode == 0
    kept = [json.loads((tmp_path / "out" / "jobs" / f"PPO-{place}.json").read_text()) for place in (0, 1)]
    assert kept[0] == kept[1]
    changed = tmp_path / "run-10" / "policy.json"
    changed.write_text(changed.read_text() + "\n")
    refused = _run(*asked)
    assert "PPO-1.json has the jobs of another policy" in refused.stderr
    shutil.rmtree(tmp_path / "run-10")
    assert _run(*asked).returncode == 0


def test_a_policy_of_another_machine_is_not_judged(tmp_path):
    """Observations of both machines have the same length, and mean something else."""
    refused = _run(
        "--out",
        str(tmp_path / "a"),
        "--machines",
        "1",
        "--env",
        "chaosgym/SliderCrankTolerance-v0",
        "--controllers",
        "--policy",
        f"PPO={shipped_folder(NOMINAL)}",
    )
    assert "it was trained on chaosgym/ImpactBeam-v0" in refused.stderr
    assert not list((tmp_path / "a").glob("jobs/PPO*"))


@pytest.mark.parametrize("wrong", [("--env", "nope"), ("--pool", "bogus"), ("--machines", "-1"), ("--repeats", "0")])
def test_wrong_arguments_end_in_one_line(wrong, tmp_path):
    """It names the argument."""
    refused = _run("--out", str(tmp_path / "a"), *wrong)
    assert refused.returncode == 2
    assert f"argument {wrong[0]}: " in refused.stderr.splitlines()[-1]


def test_unknown_contenders_are_refused(tmp_path):
    """The message lists the controllers; a pattern that no folder matches is named."""
    refused = _run("--out", str(tmp_path / "a"), "--controllers", "best")
    assert "allowed: random, lowest" in refused.stderr
    missing = _run("--out", str(tmp_path / "b"), "--policy", f"PPO={tmp_path}/none-*")
    assert "allowed: NAME=FOLDERS" in missing.stderr
    assert list(tmp_path.iterdir()) == []
