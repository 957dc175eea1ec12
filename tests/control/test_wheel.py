"""The built wheel alone plays an agent."""

import json
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent


def _run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_wheel_alone_plays_a_policy(folder, tmp_path, monkeypatch):
    """In a fresh environment, without torch and stable-baselines3, run-agent plays and draws a job."""
    monkeypatch.delenv("PYTHONPATH", raising=False)
    _run(sys.executable, "-m", "build", "--wheel", "--outdir", tmp_path, ROOT)
    (wheel,) = tmp_path.glob("*.whl")
    venv.create(tmp_path / "fresh", with_pip=True)
    python = tmp_path / "fresh" / "bin" / "python"
    _run(python, "-m", "pip", "install", wheel)
    assert "torch" not in _run(python, "-m", "pip", "list")
    out = tmp_path / "job.gif"
    told = _run(
        python.with_name("chaosgym"),
        "run-agent",
        "chaosgym/ImpactBeam-v1",
        "--policy",
        folder,
        "--out",
        out,
        "--json",
        cwd=tmp_path,
    )
    assert json.loads(told)["status"] == "job_done"
    assert out.stat().st_size > 10_000
    shipped = _run(python.with_name("chaosgym"), "run-agent", "chaosgym/ImpactBeamTolerance-v1", "--json", cwd=tmp_path)
    assert json.loads(shipped)["status"] == "job_done"
