"""The published comparisons are what the published jobs give."""

import json
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from chaosgym.control.policies.shipped import shipped_folder

ROOT = Path(__file__).parent.parent.parent
FOLDERS = sorted((ROOT / "agents" / "evaluations").iterdir())


def _published(env):
    """Rows of the table of an environment in docs/controllers.md, by contender."""
    text = (ROOT / "docs" / "controllers.md").read_text().split(f"### What came out: `chaosgym/{env}`")[1]
    lines = text.split("| contender |")[1].split("\n\n")[0].splitlines()[2:]
    rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    return {row[0]: row for row in rows}


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_table_of_the_documentation_is_that_of_the_jobs(folder, tmp_path):
    """Seeds, return, score and Type III of every contender whose jobs are published; nobody is run again."""
    copy = shutil.copytree(folder, tmp_path / folder.name)
    command = [sys.executable, ROOT / "agents" / "evaluate.py", "--env", f"chaosgym/{folder.name}", "--out", copy]
    done = subprocess.run([*map(str, command), "--controllers", "--json"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    published = _published(folder.name)
    for name, found in json.loads(done.stdout)["contenders"].items():
        row = published[name]
        assert row[1] == found["knows"]
        assert [int(row[2]), row[3], row[4]] == [found["seeds"], f"{found['return']:.3f}", f"{found['score']:.2f}"]
        assert row[7] == f"{found['type_iii_share']:.1%}"


@pytest.mark.parametrize("name", ["ImpactBeamTolerance-v0", "SliderCrankTolerance-v0"])
def test_the_shipped_policy_is_one_of_those_compared(name):
    """The jobs of a comparison name the policy that ran them, by the hash of its description."""
    shipped = sha256((shipped_folder(f"chaosgym/{name}") / "policy.json").read_bytes()).hexdigest()
    jobs = (ROOT / "agents" / "evaluations" / name / "jobs").glob("PPO, identified-*.json")
    assert shipped in [json.loads(path.read_text()).get("policy") for path in jobs]
