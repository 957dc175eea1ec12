"""A comparison keeps one row a job, goes on where it stopped, and scores in pairs; one line evaluates a policy."""

import sys

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

import chaosgym
from chaosgym.control import comparison
from chaosgym.control.comparison import LOAD, compare, joined, read_comparison
from chaosgym.control.controllers import BackOff, Follow
from chaosgym.control.evaluation import policy_of
from chaosgym.control.maps import model_keywords
from chaosgym.control.policies import TrainedPolicy, save_policy
from chaosgym.control.policies.export import exported
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.rollout import play
from chaosgym.control.scores import ONE, ZERO, Scores, table_lines
from chaosgym.envs import SB3VecEnv
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import DatasetError, ModelFileError, ParameterError
from chaosgym.rating_life import LIFE_EXPONENT

BEAM = "chaosgym/ImpactBeamTolerance-v1"


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Three controllers on four machines."""
    out = tmp_path_factory.mktemp("comparison") / "beam.parquet"
    return compare(BEAM, out, machines=4, only=[ZERO, ONE, "back off"]), out


def test_following_scores_0_and_the_own_map_1(table):
    """By definition, with intervals that have no width; the others have one."""
    summary = Scores(table[0]).summary()
    assert summary[ZERO]["score"] == 0.0
    assert summary[ONE]["score"] == 1.0
    assert summary[ONE]["score_interval"] == pytest.approx([1.0, 1.0])
    low, high = summary["back off"]["score_interval"]
    assert low <= summary["back off"]["score"] <= high
    assert low < high
    assert len(table_lines(summary)) == 5
    assert all(row["against_back_off"] is None for row in summary.values())  # with memory, which has not played


def test_what_is_won_is_told_in_newtons_and_ratios_of_life(table):
    """The constant force of the same damage follows from it; no hours, for which nobody stated a load rating."""
    played = play(BackOff(remembers=False), BEAM, range(4))
    row = Scores(table[0]).row("back off")
    task = native_envs(BEAM).task
    steady = 95.0 * (played.damage / task.reference_damage) ** (1 / LIFE_EXPONENT)
    assert row["equivalent_force_N"] == pytest.approx(np.prod(steady) ** (1 / 4))
    assert f"| x{row['life']:.2f} |" in table_lines({"back off": row})[-1]


def test_jobs_of_an_earlier_version_have_ratios_alone(table):
    """A file without forces goes on, and no mean is taken over a part of its machines."""
    earlier = table[0].filter(pa.compute.less(table[0]["machine"], 2)).drop_columns([LOAD])
    for found in (earlier, joined(earlier, table[0].filter(pa.compute.greater(table[0]["machine"], 1)))):
        row = Scores(found).row("back off")
        assert row["equivalent_force_N"] is None
        assert f"| x{row['life']:.2f} |" in table_lines({"back off": row})[-1]


def test_a_comparison_goes_on(table, monkeypatch):
    """What the file holds is not played again; other contenders are added to it."""
    played = []
    monkeypatch.setattr(comparison, "play", lambda policy, *_, **__: played.append(policy) or pytest.fail("played"))
    again = compare(BEAM, table[1], machines=4, only=[ZERO, ONE, "back off"])
    assert played == []
    assert again.equals(table[0])


def test_more_machines_are_added(table, tmp_path):
    """A comparison on two machines that goes on to four holds the jobs of one that had four from the start."""
    out, names = tmp_path / "beam.parquet", [ZERO, "back off"]
    compare(BEAM, out, machines=2, only=names)
    order = [("contender", "ascending"), ("machine", "ascending")]
    from_the_start = table[0].filter(pa.compute.not_equal(table[0]["contender"], ONE))
    assert compare(BEAM, out, machines=4, only=names).sort_by(order).equals(from_the_start.sort_by(order))


def test_there_are_no_more_machines_than_are_kept(tmp_path):
    """256 of development and 512 sealed ones; a level, a split and a seal are part of what a file is of."""
    out = tmp_path / "beam.parquet"
    for sealed, kept in ((False, 256), (True, 512)):
        with pytest.raises(
            ParameterError, match=f"machines = {kept + 1} is out of range; allowed: whole numbers from 1 to {kept}"
        ):
            compare(BEAM, out, machines=kept + 1, only=[ZERO], sealed=sealed)
    compare(BEAM, out, machines=2, only=[ZERO], level="fleet", split="test", sealed=True)
    read_comparison(out, f"{BEAM}, level fleet, split test, sealed True")
    with pytest.raises(DatasetError, match="level fleet, split test, sealed True"):
        compare(BEAM, out, machines=2, only=[ZERO], level="fleet", split="test")


def test_who_knows_machines_knows_those_of_training(monkeypatch):
    """Of a split and of sealed machines, models, tables and maps of the fleet are of the training split alone."""
    asked = []
    monkeypatch.setattr(comparison, "fleet_maps", lambda env, **keywords: asked.append(keywords))
    monkeypatch.setattr(comparison.controllers, "learned_tables", lambda env, **keywords: asked.append(keywords))
    contenders = comparison.Contenders(BEAM, {"level": "fleet", "split": "outside", "sealed": True}, False)
    assert contenders.fleet is contenders._tables() is None
    assert asked == [{"progress": None, "level": "fleet", "split": "train"}] * 2


def test_one_file_holds_all_jobs(table):
    """Its columns are named, its rows are those of every job, and a file of something else is refused."""
    found = read_comparison(table[1], BEAM)
    assert found.num_rows == 12
    assert found["job_return"].to_numpy().max() < 0.0
    with pytest.raises(DatasetError, match="is no comparison of chaosgym/Other"):
        read_comparison(table[1], "chaosgym/Other-v1")


@pytest.mark.parametrize("env", ["chaosgym/ImpactBeam-v1", "chaosgym/SliderCrank-v1"])
@pytest.mark.parametrize("keywords", [{}, {"fidelity": "reference"}, {"model_fidelity": "fine"}])
def test_maps_of_the_model_are_those_of_the_coarser_machine(env, keywords):
    """Keywords that put the model in the place of the machine, whatever the rung of either."""
    known = native_envs(env, **keywords)
    assert native_envs(env, **model_keywords(env, **keywords)).nominal == known.model != known.nominal


def test_an_unknown_controller_is_named(tmp_path):
    """Together with those that there are."""
    with pytest.raises(ParameterError, match="no controller 'nobody'; known: follow the demand"):
        compare(BEAM, tmp_path / "x.parquet", machines=2, only=["nobody"])
    with pytest.raises(ParameterError, match="no controller 'kriginng'; did you mean kriging"):
        compare(BEAM, tmp_path / "x.parquet", machines=2, only=["kriginng"])


def test_evaluation_takes_whatever_acts():
    """A function, a controller, a model and an exported policy that follow the demand all score 0."""
    layer = Dense(np.zeros((6, 14), np.float32), np.arange(6, dtype=np.float32), "none")
    follows = TrainedPolicy(BEAM, "trim", Network(None, (layer,)))
    # a keyword, so that the scale is computed with the kernels at hand
    policies = (lambda _: 5, Follow(), follows)
    short = {"steps": 30, "lowest_speed": 20.0, "highest_speed": 24.0, "lowest_demand": 21.0, "highest_demand": 23.0}
    scores = [chaosgym.evaluate(policy, BEAM, machines=2, **short).score for policy in policies]
    assert scores == [0.0, 0.0, 0.0]


def test_evaluation_of_a_model_is_that_of_its_file(tmp_path):
    """The .zip of a model trained on the plain observation plays as the model does."""
    model = PPO("MlpPolicy", SB3VecEnv(BEAM, 2, steps=6), n_steps=6, batch_size=12, device="cpu", seed=0)
    model.save(tmp_path / "model.zip")
    first, second = (chaosgym.evaluate(given, BEAM, machines=2) for given in (model, tmp_path / "model.zip"))
    assert first.mean_return == second.mean_return
    assert first.interval[0] <= first.score <= first.interval[1]


def test_a_file_whose_statistics_are_missing_is_refused(tmp_path):
    """Readings of 95 N where the network saw numbers around 0 would be scored as if it had learned nothing."""
    envs = VecNormalize(SB3VecEnv(BEAM, 2, steps=6))
    model = PPO("MlpPolicy", envs, n_steps=6, batch_size=12, device="cpu", seed=0).learn(12)
    model.save(tmp_path / "model.zip")
    envs.save(str(tmp_path / "statistics.pkl"))
    with pytest.raises(ModelFileError, match="trained behind VecNormalize, whose statistics are missing"):
        policy_of(tmp_path / "model.zip")
    again = VecNormalize.load(str(tmp_path / "statistics.pkl"), SB3VecEnv(BEAM, 2, steps=6))
    save_policy(exported(model, BEAM, envs), tmp_path / "new" / "folder")
    given = (model, PPO.load(tmp_path / "model.zip", env=again, device="cpu"), tmp_path / "new" / "folder")
    first, *others = (chaosgym.evaluate(each, BEAM, machines=2).mean_return for each in given)
    assert others == pytest.approx([first, first])


@pytest.mark.parametrize(
    ("given", "why"),
    [("none.zip", "none.zip does not exist"), (3, "3 is no policy"), (Follow, r"Follow is a class; .* Follow\(\)")],
)
def test_what_is_no_policy_is_refused(given, why):
    """A missing file, a number, and a class in the place of a controller."""
    with pytest.raises(ModelFileError, match=why):
        policy_of(given)


def test_a_model_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    """A .zip is read by stable-baselines3, which is an extra."""
    (tmp_path / "model.zip").touch()
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(ModelFileError, match=r"model\.zip needs the extra \[learn\]"):
        policy_of(tmp_path / "model.zip")


def test_more_machines_than_are_kept_are_refused():
    """One line names how many there are."""
    with pytest.raises(ParameterError, match="machines = 257 is out of range; allowed: whole numbers from 1 to 256"):
        chaosgym.evaluate(Follow(), BEAM, machines=257)
