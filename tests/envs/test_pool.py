"""Any machine: each job draws one of a pool, and speeds and forces are shares of its own range and rated force."""

import json

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import pytest
from click.testing import CliRunner
from gymnasium.utils.env_checker import check_env

import chaosgym
from benchmarks.envs import pool as made
from chaosgym.cli import app
from chaosgym.control.comparison import compare
from chaosgym.control.controllers import Follow, Kriging
from chaosgym.control.rollout import play
from chaosgym.control.scores import Scores
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.pool import SPLITS, Pool, machine_of, read_pool
from chaosgym.errors import ParameterError
from chaosgym.machines.family import KINDS, MODES
from chaosgym.plotting.played_job import draw_forces
from chaosgym.simulation import simulate

ANY = "chaosgym/AnyMachine-v0"


def test_it_is_an_environment():
    """Gymnasium's own checker has nothing to say."""
    check_env(gym.make(ANY).unwrapped)


def test_sensors_of_any_machine_err_as_those_of_the_beam():
    """1.25 % of the rated force."""
    assert gym.make(ANY).unwrapped.task.sensor_error == 0.0125


def test_same_seed_same_bytes_alone_and_side_by_side():
    """Four jobs on machines of several kinds: each sub-environment does what a single one with its seed does."""
    envs = gym.make_vec(ANY, num_envs=4)
    seen, _ = envs.reset(seed=7)
    singles = [gym.make(ANY).unwrapped for _ in range(4)]
    alone = [env.reset(seed=7 + k)[0] for k, env in enumerate(singles)]
    actions, rng = np.zeros(4, int), np.random.default_rng(0)
    for _ in range(12):
        np.testing.assert_array_equal(seen, np.array(alone))
        actions = rng.integers(0, 6, 4)
        seen, rewards, *_ = envs.step(actions)
        steps = [env.step(action) for env, action in zip(singles, actions, strict=True)]
        alone = [step[0] for step in steps]
        np.testing.assert_array_equal(rewards, [step[1] for step in steps])
    assert len({env.machine.clearance for env in singles}) == 4
    assert len({env.machine.drives[0].kind for env in singles}) == 2


def test_a_step_is_the_machine_at_its_own_speed_in_newtons():
    """Ten cycles without ripple after the run-in: the largest force is that of a simulation of the same machine."""
    env = gym.make(ANY, speed_ripple=0.0, sensor_error=0.0, action="speed").unwrapped
    env.reset(seed=3, options={"speed": 0.25})
    observation, _, _, _, info = env.step(np.array([0.25], np.float32))
    row = next(row for row in read_pool() if machine_of(row.kind, row.number).machine.modes is env.machine.modes)
    found = machine_of(row.kind, row.number)
    assert env.machine.speed == found.lowest + 0.25 * (found.highest - found.lowest)
    record = simulate(env.machine, 40)
    peaks = record.peak_force[30:].max(axis=1)
    assert info["largest_force"] == pytest.approx(peaks.max(), rel=1e-9)
    assert observation[PLACE.mean_peak_force] == pytest.approx(min(peaks.mean() / row.force, 5.0), rel=1e-5)


def test_splits_share_no_machine_and_keep_kinds_apart():
    """Two kinds are held out of training and test; all of each split can be drawn."""
    rows = read_pool()
    assert len({(row.kind, row.number) for row in rows}) == len(rows)
    kinds = {split: {row.kind for row in rows if row.split == split} for split in SPLITS}
    assert kinds == {
        "train": {"force", "unbalance"},
        "test": {"force", "unbalance"},
        "other_machines": {"base", "gear"},
    }
    assert Pool().count == Pool("test").count == 256
    assert set(KINDS) == {row.kind for row in rows}
    assert all(machine_of(row.kind, row.number).machine.n_states == 2 * MODES for row in rows[::97])


def test_the_file_is_what_the_command_makes():
    """The first machines of a split and their rated forces, drawn and filtered again; chaos hangs on rounding."""
    kept = [row for row in read_pool() if row.split == "other_machines"][:2]
    found = made.kept_machines(made.OTHER)
    for row in kept:
        kind, number, force = next(found)
        assert (kind, number) == (row.kind, row.number)
        assert force == pytest.approx(row.force, rel=1e-2)


def test_what_following_costs_is_alike_on_all_machines():
    """Machines of 15 Hz and 10 N or not, a job that follows uses up 0.28 of a life in the middle, as on the beam."""
    played = play(Follow(), ANY, range(24))
    assert np.median(played.damage) == pytest.approx(made.FOLLOWING, rel=0.3)
    assert played.unit == "of the range"


def test_a_comparison_plays_all_but_who_needs_a_model(tmp_path):
    """Kriging is between following and the own map; a policy is scored in one line."""
    scores = Scores(compare(ANY, tmp_path / "any.parquet", machines=3))
    assert set(scores.summary()) == {
        *("follow the demand", "own map", "own map, demands known"),
        *("back off", "back off, with memory", "kriging", "best felt"),
    }
    assert scores.row("kriging")["score"] > 0.0
    assert chaosgym.evaluate(Kriging(), ANY, machines=2, split="other_machines").deviation <= 1.0 / 7.0


@pytest.mark.parametrize(
    ("keywords", "told"),
    [
        ({"split": "outside"}, "split = 'outside' is not one of train, test, other_machines"),
        ({"level": "fleet"}, "level is nothing that can be set"),
        ({"clearance": 1e-4}, "clearance is nothing that can be set"),
        ({"render_mode": "rgb_array"}, "render_mode = 'rgb_array' is not possible with any machine"),
        ({"steps": 0}, "steps = 0 is out of range"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(keywords, told):
    """Machines are drawn: their fields and levels can't be chosen."""
    with pytest.raises(ParameterError, match=told):
        gym.make(ANY, **keywords)


def test_a_picture_of_a_job_names_the_units_of_what_is_felt():
    """Forces of any machine are shares of its rated one, those of a beam newtons."""
    for env, unit in ((ANY, "of the rated one"), ("chaosgym/ImpactBeam-v1", "N")):
        played = play(Follow(), env, [0], steps=2)
        assert f"peak force [{unit}]" in draw_forces(played, plt.figure().add_subplot()).get_ylabel()
    plt.close("all")


def test_a_job_in_the_terminal_names_the_unit_of_what_is_felt():
    """A mean peak of 0.8 is a share of the rated force, in the table and as JSON."""
    done = CliRunner().invoke(app, ["run-agent", ANY, "--machine", "3"])
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert "mean peak [of the rated one]  Type III" in lines[0]
    assert "[job] in the file" not in done.stdout
    told = json.loads(CliRunner().invoke(app, ["run-agent", ANY, "--machine", "3", "--json"]).stdout)
    assert "mean_peak_force_N" not in told
    assert told["mean_peak_force_share"][10] == pytest.approx(float(lines[2].split()[3]), abs=6e-4)


def test_other_machines_are_compared_by_command(tmp_path):
    """``chaosgym compare --split`` plays the kinds on which nothing was tuned; a split that is not there is named."""
    given = ["compare", ANY, "--machines", "2", "--only", "follow the demand", "--out", str(tmp_path / "any.parquet")]
    done = CliRunner().invoke(app, [*given, "--split", "other_machines", "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["contenders"]["follow the demand"]["machines"] == 2
    refused = CliRunner().invoke(app, [*given, "--split", "outside"])
    assert isinstance(refused.exception, ParameterError)
    assert "other_machines" in str(refused.exception)
