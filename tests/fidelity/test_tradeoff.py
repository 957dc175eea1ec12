"""The measured fidelity ladder: what it compares, and that its figures mean what they say."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym.cli import app
from chaosgym.errors import ParameterError
from chaosgym.fidelity.sample import operating_points
from chaosgym.fidelity.tradeoff import _measure, settings_of, tradeoff
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.plotting.fidelity import tradeoff_figure


@pytest.fixture(scope="module")
def beam_ladder():
    """A small sample; fixed steps beyond the budget are left out of it."""
    return tradeoff(ImpactBeam(), points=2, cycles=24, transient=10, budget=0.1, workers=1)


def _row(result, rung, method="exact", step=0.5):
    return next(row for row in result.rows if (row.rung, row.method, row.step) == (rung, method, step))


def test_every_rung_method_and_step_has_its_row(beam_ladder):
    """Three rungs by exact events, and the default one by three steps of Runge-Kutta's method; none was refused."""
    assert len(beam_ladder.rows) == len(settings_of(ImpactBeam())) == 3 + 3
    assert not beam_ladder.refused
    assert all(row.microseconds_per_cycle * row.cycles_per_second == pytest.approx(1e6) for row in beam_ladder.rows)


def test_the_reference_agrees_with_itself(beam_ladder):
    """Its own row has no error, full agreement and all points, whatever it costs."""
    row = _row(beam_ladder, "reference")
    assert (row.trajectory_error, row.wasserstein, row.nature_agreement, row.type_agreement) == (0.0, 0.0, 1.0, 1.0)
    assert row.points == 2
    assert row.on_front


def test_finer_rungs_are_nearer(beam_ladder):
    """From rung to rung both the path and the distribution of peak forces come nearer."""
    rows = [_row(beam_ladder, rung) for rung in ("standard", "fine", "reference")]
    for name in ("trajectory_error", "wasserstein", "mean_error"):
        values = [getattr(row, name) for row in rows]
        assert values == sorted(values, reverse=True)


def test_the_front_is_not_beaten(beam_ladder):
    """Nothing measured at all points is both cheaper and nearer than a setting on the front."""
    full = [row for row in beam_ladder.rows if row.points == 2]
    for row in (row for row in full if row.on_front):
        assert not any(
            other.microseconds_per_cycle < row.microseconds_per_cycle and other.wasserstein < row.wasserstein
            for other in full
        )


def test_a_setting_beyond_its_budget_is_compared_where_it_got(beam_ladder):
    """The finest steps are too slow for the budget; they keep their cost and their path, which is the rung's own."""
    row = _row(beam_ladder, "standard", "Runge-Kutta 4", 0.1)
    assert row.points < 2
    assert row.microseconds_per_cycle > 1000.0
    assert row.trajectory_error == pytest.approx(_row(beam_ladder, "standard").trajectory_error, rel=0.1)
    assert not row.on_front


def test_results_are_plain_values_and_draw(beam_ladder):
    """JSON without NaN; two panels with one mark a row and the front."""
    json.dumps(beam_ladder.as_dict(), allow_nan=False)
    left, right = tradeoff_figure(beam_ladder).axes
    assert len(left.lines) == sum(row.wasserstein is not None for row in beam_ladder.rows) + 1
    assert right.get_xlabel() == "processor time [µs per cycle]"


def test_the_sample_covers_the_usual_range():
    """Operating points lie inside it, spread over both halves of either axis, and are the same every time."""
    points = operating_points(SliderCrank(), 16)
    low, high = np.array([SliderCrank.usual_ranges[name] for name in ("crank_speed", "slider_clearance")]).T
    assert np.all((points >= low) & (points <= high))
    middle = np.sqrt(low * high)
    assert np.all(np.abs((points > middle).mean(axis=0) - 0.5) <= 0.1)
    np.testing.assert_array_equal(points, operating_points(SliderCrank(), 16))
    with pytest.raises(ParameterError, match="points = 0"):
        operating_points(SliderCrank(), 0)


def test_command_writes_its_files(tmp_path):
    """``tradeoff --out`` prints the table and leaves JSON and a figure."""
    options = ["--points", "1", "--cycles", "20", "--transient", "0", "--budget", "0.05", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["tradeoff", "impact-beam", *options])
    assert done.exit_code == 0, done.output
    assert "reference" in done.output
    assert (tmp_path / "tradeoff.png").stat().st_size > 10_000
    assert json.loads((tmp_path / "tradeoff.json").read_text())["machine"] == "impact-beam"


def test_a_point_beyond_the_budget_is_not_begun(monkeypatch):
    """A clock that ticks once a look: a cycle takes half a second, and a point its transient as well."""
    ticks = iter(range(10**6))
    monkeypatch.setattr("chaosgym.fidelity.tradeoff.time", SimpleNamespace(thread_time=lambda: next(ticks)))
    found = [
        _measure(ImpactBeam(), settings_of(ImpactBeam())[0], np.array([[12.0, 1e-4]]), 24, 10, budget).points
        for budget in (16.9, 17.1)
    ]
    assert [len(points) for points in found] == [0, 1]
