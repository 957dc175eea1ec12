"""Training curves survive their table, and its means are those of the runs."""

import json

import numpy as np
import pytest

from benchmarks.envs.curves import at, curve_figure, curve_lines, read_curve, read_table, replaced, write_table
from chaosgym.errors import DatasetError

BEAM = "chaosgym/ImpactBeamTolerance-v1"


@pytest.fixture
def run(tmp_path):
    """A run whose return is its number of steps in thousands less 100."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "policy.json").write_text(json.dumps({"env": BEAM}))
    rows = "".join(f"{step},{step / 1000 - 100},0.25,0.5,{step / 1000}\n" for step in range(10_000, 110_000, 10_000))
    (folder / "progress.csv").write_text("step,return,type_iii,deviation,processor_seconds\n" + rows)
    return folder


def test_a_table_gives_back_its_curves(run, tmp_path):
    """Whatever characters are in the name of the agent."""
    name = 'PPO, "from" another'
    curves = [read_curve(name, run), read_curve(name, run), read_curve("PPO", run)]
    write_table(curves, tmp_path / "table.csv")
    again = read_table(tmp_path / "table.csv")
    assert [(curve.agent, curve.env) for curve in again] == [(name, BEAM), (name, BEAM), ("PPO", BEAM)]
    for one, other in zip(curves, again, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
    assert len(curve_lines(again)) == 4
    assert len(curve_figure(again).axes) == 2


def test_runs_take_the_place_of_those_of_the_same_agent_and_level(run):
    """A run at another level is another curve; lines of the fleet's comparison are drawn beside it."""
    one, fleet = read_curve("PPO", run), read_curve("PPO", run, "fleet")
    again = replaced([one, fleet, read_curve("SAC", run)], [fleet, fleet])
    assert [(curve.agent, curve.env) for curve in again] == [
        ("PPO", BEAM),
        ("SAC", BEAM),
        *[("PPO", f"{BEAM}, level fleet")] * 2,
    ]
    beside = curve_figure([fleet]).axes[0].lines
    assert {line.get_label() for line in beside} >= {"follow the demand", "table", "shipped learned map"}


def test_a_value_is_the_mean_of_the_last_50_000_steps(run):
    """Of 60,000 to 100,000 steps at 100,000, and none beyond the end."""
    values = read_curve("PPO", run).values
    assert at(values, 100_000)[1] == pytest.approx(80.0 - 100.0)
    assert np.isnan(at(values, 200_000)).all()


def test_a_run_that_has_not_ended_is_named(tmp_path):
    """A folder without a policy, and a table that is none."""
    with pytest.raises(DatasetError, match="no finished training run"):
        read_curve("PPO", tmp_path)
    (tmp_path / "table.csv").write_text("a,b\n1,2\n")
    with pytest.raises(DatasetError, match="can't be read as training curves"):
        read_table(tmp_path / "table.csv")
