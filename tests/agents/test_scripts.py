"""Scripts that train: what they begin with, learn from and refuse; tests/test_kills.py has them train and go on."""

import csv
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import chaosgym
from chaosgym.control.comparison import read_comparison
from chaosgym.control.policies import load_policy
from chaosgym.control.rollout import play
from chaosgym.envs import SB3VecEnv
from chaosgym.envs.sense import STATISTICS, load_sense

AGENTS = Path(__file__).parent.parent.parent / "agents"
BEAM = "chaosgym/ImpactBeamTolerance-v1"
WORN = "chaosgym/ImpactBeamWear-v1"
OWN = str(AGENTS.parent / "docs" / "machines" / "moon-shaw-1983.toml")
SMALL = ("--envs", "32", "--rollout", "60", "--batch", "240")
SCRIPTS = ("ppo", "recurrent_ppo", "learn_map", "learn_sense")


@pytest.mark.parametrize("script", [*SCRIPTS, "sac", "constrained_ppo", "learn_sequence"])
@pytest.mark.parametrize("package", ["torch", "stable_baselines3"])
def test_a_script_without_its_packages_names_the_extra(script, package, monkeypatch):
    """It ends with one line, before anything else is loaded."""
    monkeypatch.syspath_prepend(AGENTS)
    for name in [package, *(name for name in sys.modules if name.startswith(f"{package}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "training", raising=False)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(AGENTS / f"{script}.py"))
    assert str(ended.value).startswith("Error: training needs the extra [learn]: pip install '.[learn]'")


def _train(script, out, steps, *options):
    command = [sys.executable, AGENTS / f"{script}.py", "--steps", steps, "--out", out, *options]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("env", [WORN, OWN])
def test_a_training_begins_with_another_policy(env, tmp_path):
    """With too few steps to learn from, it plays as the one that it began with, also on a machine of one's own."""
    small = ("--memory", "--envs", "4", "--rollout", "10", "--batch", "40")
    _train("ppo", tmp_path / "first", 40, *small)
    _train("ppo", tmp_path / "second", 40, "--env", env, "--start", tmp_path / "first", "--learning-rate", 0, *small)
    first, second = (load_policy(tmp_path / name) for name in ("first", "second"))
    for one, other in zip(first.network.layers, second.network.layers, strict=True):
        assert (one.weight == other.weight).all()
    assert second.env == env
    assert (second.usual.count.sum() > first.usual.count.sum()) == (env == WORN), "what is usual belongs to a machine"


@pytest.mark.slow
def test_a_map_is_learned_from_jobs_that_are_not_run_again(tmp_path):
    """A run that goes on has the bytes of one that never stopped, and its policy plays both objectives."""
    small = ("--envs", "4", "--epochs", "2", "--units", "16", "--keywords", '{"level": "fleet", "split": "train"}')
    _train("learn_map", tmp_path / "whole", 960, *small)
    _train("learn_map", tmp_path / "parts", 480, *small)
    first = (tmp_path / "parts" / "weights.npz").read_bytes()
    _train("learn_map", tmp_path / "parts", 960, *small)
    whole = (tmp_path / "whole" / "weights.npz").read_bytes()
    assert first != (tmp_path / "parts" / "weights.npz").read_bytes() == whole
    rows = list(csv.DictReader((tmp_path / "whole" / "progress.csv").read_text().splitlines()))
    assert [row["epoch"] for row in rows] == ["1", "2"]
    for objective in ("irregular", "life"):
        job = play(load_policy(tmp_path / "whole"), BEAM, range(2), level="fleet", objective=objective, steps=20)
        assert job.deviation.max() < 3.0


def test_a_sense_is_learned_from_rounds_that_are_not_run_again(tmp_path, monkeypatch):
    """A run that goes on has the bytes of one that never stopped, and its sense tells probabilities."""
    monkeypatch.syspath_prepend(str(AGENTS))
    import learn_sense

    small = ["--envs", "2", "--epochs", "2", "--units", "16", "--batch", "64"]
    fleet = ["--keywords", '{"level": "fleet", "split": "train"}']
    rounds, play_one = [], learn_sense.play
    monkeypatch.setattr(learn_sense, "play", lambda asked, k: rounds.append(k) or play_one(asked, k))

    def train(name, steps):
        """What the script does with these arguments."""
        monkeypatch.setattr(
            sys, "argv", ["learn_sense", "--steps", steps, "--out", str(tmp_path / name), *small, *fleet]
        )
        learn_sense.run(learn_sense.train, learn_sense.arguments())

    train("whole", "480")
    train("parts", "240")
    first = (tmp_path / "parts" / "sense.npz").read_bytes()
    train("parts", "480")
    assert rounds == [0, 1, 0, 1], "two of the whole, one of each part"
    assert first != (tmp_path / "parts" / "sense.npz").read_bytes() == (tmp_path / "whole" / "sense.npz").read_bytes()
    rows = list(csv.DictReader((tmp_path / "whole" / "progress.csv").read_text().splitlines()))
    assert [row["epoch"] for row in rows] == ["1", "2"]
    assert float(rows[1]["cross_entropy"]) < float(rows[0]["cross_entropy"])
    sense = load_sense(tmp_path / "whole" / "sense.npz")
    told = sense(np.random.default_rng(0).uniform(1.0, 50.0, (5, len(STATISTICS))))
    assert ((told > 0.0) & (told < 1.0)).all()


@pytest.mark.slow
def test_a_map_is_learned_from_the_jobs_of_several_runs(tmp_path):
    """What is usual there is what is usual in a run that played both; a folder without jobs is refused in one line."""
    small = ("--envs", "4", "--epochs", "2", "--units", "16")
    for name, seed in (("one", 3), ("other", 4)):
        _train("learn_map", tmp_path / name, 480, "--seed", seed, *small)
    both = (tmp_path / "one", tmp_path / "other")
    _train("learn_map", tmp_path / "both", 0, "--jobs", *both, *small)
    shutil.copytree(both[0], tmp_path / "again")
    _train("learn_map", tmp_path / "again", 480, "--seed", 3, "--jobs", both[1], *small)
    policies = [load_policy(tmp_path / name) for name in ("both", "again")]
    assert (policies[0].mean == policies[1].mean).all(), "what is usual is told by the same jobs"
    for jobs, told in (((tmp_path,), "holds no jobs"), ((), "give --steps")):
        command = [sys.executable, AGENTS / "learn_map.py", "--steps", 0, "--out", tmp_path / "none", "--jobs", *jobs]
        done = subprocess.run(
            [str(part) for part in command if jobs or part != "--jobs"], capture_output=True, text=True, check=False
        )
        assert done.returncode == 2
        assert told in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_a_sequence_model_learns_kept_jobs_and_plays(tmp_path):
    """Held-out motion is told better after each part of the fit, and what it plays is added to a comparison once."""
    fleet = ("--keywords", '{"level": "fleet", "split": "train"}')
    _train("learn_map", tmp_path / "jobs", 3_840, *fleet, "--envs", "32", "--epochs", "1", "--units", "16")
    command = [sys.executable, AGENTS / "learn_sequence.py", *fleet, "--jobs", tmp_path / "jobs", "--units", "16"]
    command += [
        "--epochs",
        150,
        "--learning-rate",
        0.003,
        "--out",
        tmp_path / "sequence",
        "--play",
        tmp_path / "test.parquet",
        "--machines",
        4,
    ]
    played = []
    for _ in range(2):
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        played.append((tmp_path / "test.parquet").read_bytes())
    assert played[0] == played[1], "a second run neither fits nor plays anew"
    rows = list(csv.DictReader((tmp_path / "sequence" / "progress.csv").read_text().splitlines()))
    assert float(rows[-1]["irregular"]) < float(rows[0]["irregular"])
    assert float(rows[-1]["decision"]) < np.log(17.0), "better than any speed of the band alike"
    table = read_comparison(tmp_path / "test.parquet")
    assert table.group_by("contender").aggregate([("machine", "count")])["machine_count"].to_pylist() == [4, 4]


def test_a_constraint_is_the_budget_of_the_task(tmp_path, monkeypatch):
    """The specification of an environment carries the budget; training without a limit of its own takes it."""
    monkeypatch.syspath_prepend(str(AGENTS))
    import constrained_ppo

    env = gym.make(BEAM, cost_budget=0.1)
    assert env.unwrapped.task.cost_budget == env.spec.kwargs["cost_budget"] == 0.1
    limits = []

    def stop(*_, cost_limit, **__):
        limits.append(cost_limit)
        raise InterruptedError

    monkeypatch.setattr(constrained_ppo, "LagrangianPPO", stop)
    for extra in ([], ["--limit", "0.2"]):
        monkeypatch.setattr(sys, "argv", ["constrained_ppo", "--envs", "2", "--out", str(tmp_path), *extra])
        with pytest.raises(InterruptedError):
            constrained_ppo.train(constrained_ppo.arguments())
    assert limits == [gym.make(BEAM).unwrapped.task.cost_budget, 0.2]


def test_the_jobs_of_a_machine_are_one_episode(monkeypatch):
    """Only the third of three jobs ends an episode; the first observation of each other job follows within it."""
    monkeypatch.syspath_prepend(str(AGENTS))
    from recurrent_ppo import JobsInOne

    given = {"jobs": 3, "steps": 4, "level": "fleet", "split": "train"}
    plain, joined = SB3VecEnv(BEAM, 2, **given), JobsInOne(SB3VecEnv(BEAM, 2, **given), 3)
    for envs in (plain, joined):
        envs.seed(5)
        envs.reset()
    clearances = []
    for step in range(1, 25):
        (expected, _, ended, _), (seen, _, last, infos) = (envs.step(np.zeros(2, int)) for envs in (plain, joined))
        np.testing.assert_array_equal(seen, expected)
        assert (ended == (step % 4 == 0)).all()
        assert (last == (step % 12 == 0)).all()
        assert [("terminal_observation" in info) for info in infos] == last.tolist()
        clearances.append(infos[0]["clearance"])
    assert len(set(clearances[::4])) == 2, "a machine for each three jobs, as new in each"


def test_what_an_export_needs_is_named(tmp_path):
    """Without Minari: exit code 2, one line that says what to install, and no folder."""
    (tmp_path / "minari.py").write_text("raise ModuleNotFoundError(\"No module named 'minari'\")")
    command = [sys.executable, str(AGENTS / "export_minari.py"), "--jobs", "1", "--out", str(tmp_path / "out")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert "pip install '.[offline,learn]'" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list((tmp_path / "out").rglob("*.json"))


@pytest.mark.slow
def test_minari_export_is_read_back(tmp_path, monkeypatch):
    """One dataset for each level, of as many whole jobs as were asked for, on machines of the split."""
    pytest.importorskip("minari")
    out = str(tmp_path / "minari")
    command = [sys.executable, str(AGENTS / "export_minari.py"), "--jobs", "2", "--out", out, "--split", "train"]
    subprocess.run([*command, "--level", "clearance", "fleet"], check=True, capture_output=True)
    monkeypatch.setenv("MINARI_DATASETS_PATH", out)
    code = """import minari
for level in ("clearance", "fleet"):
    dataset = minari.load_dataset(f"chaosgym/ImpactBeamTolerance/random-{level}-train-v1")
    print(dataset.total_steps, dataset.env_spec.kwargs["level"], dataset.env_spec.kwargs["split"])"""
    told = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert told.stdout.splitlines()[-2:] == ["240 clearance train", "240 fleet train"]
    map_of_fleet = Path(chaosgym.__file__).parent / "control/policies/shipped/ImpactBeamTolerance-v1-fleet"
    subprocess.run([*command, "--level", "fleet", "--policy", map_of_fleet], check=True, capture_output=True)
    again = subprocess.run([*command, "--level", "fleet"], capture_output=True, text=True, check=False)
    assert again.returncode == 2
    assert "exists; choose another folder" in again.stderr


@pytest.mark.parametrize(
    ("script", "text"),
    [("ppo", "{"), ("ppo", "[1]"), ("learn_sense", "[1]"), *((script, '{"tolerancs": 1}') for script in SCRIPTS)],
)
def test_keywords_that_are_none_end_in_one_line(script, text, tmp_path, monkeypatch, capsys):
    """No JSON, no object, no keyword of the environment: exit code 2 and one line that says so."""
    path = str(AGENTS / f"{script}.py")
    monkeypatch.syspath_prepend(str(AGENTS))  # as Python does for a script
    monkeypatch.setattr(sys, "argv", [path, "--keywords", text, "--out", str(tmp_path / "run")])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(path, run_name="__main__")
    assert ended.value.code == 2
    assert "keyword" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.slow
@pytest.mark.parametrize("before", [("--keywords", '{"classifier": "on"}'), ("--memory",)])
def test_a_run_with_other_observations_is_refused_in_one_line(before, tmp_path):
    """What was trained with the classifier, or with a memory, neither goes on nor begins another training."""
    _train("ppo", tmp_path / "on", 40, *before, *SMALL)
    assert (load_policy(tmp_path / "on").usual is None) == (before != ("--memory",))
    for where in (("--out", tmp_path / "on"), ("--start", tmp_path / "on", "--out", tmp_path / "off")):
        command = [sys.executable, AGENTS / "ppo.py", *where, "--steps", 80, *SMALL]
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert (
            "other observations or actions; allowed: the same machine, --keywords and --memory"
            in done.stderr.splitlines()[-1]
        )
        assert "Traceback" not in done.stderr
