"""Plans of sweeps: axes, sampling, validation."""

import json
import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import parameters_of
from chaosgym.sweeps import Axis, SweepPlan
from chaosgym.sweeps.dataset import schema
from chaosgym.sweeps.plan import default_axes
from tests.plain_modes import PLAIN_BEAM

SPEED = Axis("excitation_frequency", 4.0, 16.0, 3, "log")
CLEARANCE = Axis("clearance", 1e-5, 3e-5, 2)


def test_axis_is_read_from_text():
    """FIELD=LOW:HIGH[:COUNT][:lin|log] in every form."""
    assert Axis.parse("excitation_frequency=4:16:3:log") == SPEED
    assert Axis.parse("clearance=1e-5:3e-5:2") == CLEARANCE
    assert Axis.parse("clearance=1e-5:3e-5") == Axis("clearance", 1e-5, 3e-5)
    assert Axis.parse("clearance=1e-5:3e-5:log") == Axis("clearance", 1e-5, 3e-5, scale="log")
    assert Axis.parse("clearance=1e-5:3e-5:7:lin") == Axis("clearance", 1e-5, 3e-5, 7)


@pytest.mark.parametrize("text", ["length=0.25:0.5", "length=0.25:0.5:4", "clearance=1e-05:0.0003:1000000:log"])
def test_an_axis_is_written_as_it_is_read(text):
    """A card repeats the command that made its dataset."""
    assert str(Axis.parse(text)) == text


def test_ends_have_the_unit_of_their_field_unless_they_name_another():
    """0.1 mm are 1e-4 m, 5 % are 0.05, and what names no unit is in that of its field."""
    units = {"clearance": "m", "damping_ratio": "-"}
    assert Axis.parse("clearance=0.1 mm:3e-4", units) == Axis("clearance", 1e-4, 3e-4)
    assert Axis.parse("damping_ratio=0.01:5 %", units) == Axis("damping_ratio", 0.01, 0.05)
    with pytest.raises(ParameterError, match=r"^clearance: 'wide' is no number"):
        Axis.parse("clearance=0.1 mm:wide", units)
    with pytest.raises(ParameterError, match=r"^clearance = .* has the unknown unit 'Hz'"):
        Axis.parse("clearance=1 Hz:2 Hz", units)


def test_grid_has_every_combination_with_the_first_axis_slowest():
    """Three speeds in geometric and two clearances in arithmetic progression."""
    points = SweepPlan(PLAIN_BEAM, (SPEED, CLEARANCE)).points()
    np.testing.assert_allclose(points["excitation_frequency"], [4, 4, 8, 8, 16, 16])
    np.testing.assert_allclose(points["clearance"], [1e-5, 3e-5] * 3)


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_drawn_points_fill_the_range_and_depend_on_the_seed_alone(sampling):
    """Same seed, same points; another seed, others; all inside the ranges."""
    axes = (Axis("excitation_frequency", 4.0, 16.0, scale="log"), Axis("clearance", 1e-5, 3e-5))
    first, again, other = (SweepPlan(PLAIN_BEAM, axes, sampling, 100, seed).points() for seed in (1, 1, 2))
    for name, low, high in (("excitation_frequency", 4.0, 16.0), ("clearance", 1e-5, 3e-5)):
        np.testing.assert_array_equal(first[name], again[name])
        assert not np.array_equal(first[name], other[name])
        assert low <= first[name].min() < low + 0.1 * (high - low)
        assert high - 0.2 * (high - low) < first[name].max() <= high
    if sampling == "random":
        drawn = np.random.default_rng(1).random((100, 2))
        np.testing.assert_allclose(first["clearance"], 1e-5 + 2e-5 * drawn[:, 1])


@pytest.mark.parametrize("sampling", ["grid", "random", "sobol", "crosses"])
def test_any_rows_can_be_computed_by_themselves(sampling):
    """Chunks of points together are the whole plan, bit for bit."""
    grid = sampling == "grid"
    axes = (
        Axis("clearance", 1e-5, 3e-5, 30 if grid else None, "log"),
        Axis("excitation_frequency", 4.0, 16.0, 40 if grid else None),
    )
    plan = SweepPlan(PLAIN_BEAM, axes, sampling, 0 if grid else 300, 1)
    whole = plan.points()
    for rows in plan.chunks():
        for name, column in plan.points(rows).items():
            np.testing.assert_array_equal(column, whole[name][rows.start : rows.stop])
    assert sum(len(rows) for rows in plan.chunks()) == len(plan)


HIGHEST = parameters_of(PLAIN_BEAM)["excitation_frequency"].high
CROSS_AXES = (Axis("length", 0.265, 0.293), Axis("excitation_frequency", 1.0, 40.0), Axis("clearance", 1e-5, 3e-4))


def test_types_say_what_they_were_found_from():
    """Rows of a grid have the points beside them, rows of crosses the arms of the cross."""
    grid = SweepPlan(PLAIN_BEAM, (Axis("clearance", 1e-5, 3e-5, 3),))
    told = [
        schema(plan, {}).field("response_type").metadata
        for plan in (grid, SweepPlan(PLAIN_BEAM, CROSS_AXES, "crosses", 2, 2))
    ]
    assert told[0] != told[1]
    assert b"cross" in told[1][b"meaning"]
    assert b"cross" not in told[0][b"meaning"]


def test_arms_of_a_cross_are_one_tolerance_long():
    """2 % of speed and 5 % of clearance around every centre; centres fill the ranges, and nothing else differs."""
    plan = SweepPlan(PLAIN_BEAM, CROSS_AXES, "crosses", 256, 2)
    points = {name: column.reshape(256, 5) for name, column in plan.points().items()}
    speed, clearance = points["excitation_frequency"], points["clearance"]
    np.testing.assert_allclose(speed / speed[:, :1], np.tile([1.0, 1 / 1.02, 1.02, 1.0, 1.0], (256, 1)))
    np.testing.assert_allclose(clearance / clearance[:, :1], np.tile([1.0, 1.0, 1.0, 1 / 1.05, 1.05], (256, 1)))
    assert np.ptp(points["length"], axis=1).max() == 0.0
    assert np.histogram(speed[:, 0], bins=8, range=(1.0, 40.0))[0].min() > 15
    assert plan.type_neighbours(range(6)).tolist() == [4, 0, 0, 0, 0, 4]


def test_the_split_of_a_machine_does_not_depend_on_how_many_there_are():
    """A larger dataset of the same seed keeps the machines of the smaller one, and the part of each."""
    small, large = (SweepPlan(PLAIN_BEAM, CROSS_AXES, "crosses", size, 2) for size in (64, 512))
    rows = range(5 * 64)
    assert small.splits(rows) == large.splits(rows)
    for name, column in small.points(rows).items():
        np.testing.assert_array_equal(column, large.points(rows)[name])
    parts = large.splits(range(len(large)))
    assert large.splits(range(1000, 1300)) == parts[1000:1300]
    huge = SweepPlan(PLAIN_BEAM, CROSS_AXES, "crosses", 10**8, 2)
    began = time.process_time()
    assert huge.splits(rows) == small.splits(rows)
    assert set(huge.splits(range(len(huge) - 255, len(huge)))) <= {"train", "validation", "test"}
    tracemalloc.start()
    assert len(huge.points(range(len(huge) - 255, len(huge)))["clearance"]) == 255
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()
    assert len(huge.points(range(7, 7))["clearance"]) == 0
    assert time.process_time() - began < 0.5, "the cost of a chunk does not grow with the plan"
    assert 0.6 < parts.count("train") / len(parts) < 0.8


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        (CROSS_AXES[:2], "crosses need an axis of clearance"),
        ((Axis("excitation_frequency", 1.0, HIGHEST), CROSS_AXES[2]), "excitation_frequency = "),
    ],
)
def test_crosses_lie_in_speed_and_clearance(axes, message):
    """Both must be axes, and the arms must stay inside what the machine allows."""
    with pytest.raises(ParameterError, match=message):
        SweepPlan(PLAIN_BEAM, axes, "crosses", 8)


def test_plans_survive_their_settings():
    """Settings, as JSON keeps them, give the plan again; those of another kind of sampling are refused."""
    plan = SweepPlan(PLAIN_BEAM, CROSS_AXES, "crosses", 7, 3, 200, 0.2, 0.1)
    assert SweepPlan.from_settings(json.loads(json.dumps(plan.settings()))) == plan
    without_search = {name: value for name, value in plan.settings().items() if name != "initial_states"}
    assert SweepPlan.from_settings(without_search) == replace(plan, initial_states=3)
    assert replace(plan, initial_states=3).settings() == without_search
    without_definition = {name: value for name, value in plan.settings().items() if name != "definition"}
    assert SweepPlan.from_settings(without_definition) == replace(plan, definition="thesis")
    assert replace(plan, definition="thesis").settings() == without_definition
    with pytest.raises(ParameterError, match="definition = 'mine' is unknown; allowed: settled, thesis"):
        replace(plan, definition="mine")
    with pytest.raises(ParameterError, match="sampling = 'lattice' is unknown; allowed: grid, random, sobol, crosses"):
        SweepPlan.from_settings(plan.settings() | {"sampling": "lattice"})


def test_whole_numbers_stay_whole():
    """A random axis over a count gives counts."""
    plan = SweepPlan(PLAIN_BEAM, (Axis("n_modes", 1, 8),), "random", 50)
    modes = plan.points()["n_modes"]
    assert set(modes) <= set(range(1, 9))
    assert plan.machine_at({"n_modes": modes[0]}).n_modes == modes[0]


def test_default_axes_are_speed_and_clearance():
    """With no axis a sweep covers the machine's usual ranges."""
    fields = [axis.field for axis in default_axes(PLAIN_BEAM, "grid")]
    assert fields == ["excitation_frequency", "clearance"]


def test_types_reach_one_tolerance_far():
    """2 % steps of speed are one step per tolerance (+-2 %), 2.5 % steps of clearance two (+-5 %), coarse ones none."""
    fine = Axis("excitation_frequency", 10.0, 10.0 * 1.02**20, 21, "log")
    half = Axis("clearance", 1e-4, 1e-4 * 1.025**10, 11, "log")
    coarse = Axis("clearance", 1e-5, 1e-3, 4, "log")
    assert SweepPlan(PLAIN_BEAM, (fine, half)).type_reach() == {"excitation_frequency": 1, "clearance": 2}
    assert SweepPlan(PLAIN_BEAM, (fine, coarse)).type_reach() == {}


def test_a_point_counts_the_points_of_its_tolerances():
    """One step of speed and two of clearance: 3 x 5 points less the one in the middle; 2 x 3 less one in a corner."""
    fine = Axis("excitation_frequency", 10.0, 10.0 * 1.02**20, 21, "log")
    half = Axis("clearance", 1e-4, 1e-4 * 1.025**10, 11, "log")
    plan = SweepPlan(PLAIN_BEAM, (fine, half))
    assert plan.all_neighbours == 14
    found = plan.type_neighbours(range(len(plan))).reshape(plan.shape)
    assert (found[0, 0], found[10, 5]) == (5, 14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("clearance", "not of the form"),
        ("clearance=1e-5", "not of the form"),
        ("clearance=a:b:3", "not of the form"),
        ("clearance=3e-5:1e-5:4", "^axis clearance = 3e-05:1e-05 is empty or reversed"),
        ("clearance=0:1e-5:4:log", "can't be logarithmic"),
        ("clearance=0:1e-5:1", "count of axis clearance = 1 is out of range"),
        ("clearance=0:1e-5:1000001", "count of axis clearance = 1000001 is out of range"),
        ("clearance=1e-5:1e-5", "empty or reversed"),
        ("clearance=1e-5:inf", "high end of axis clearance = inf is out of range; allowed: a finite number"),
        ("clearance=nan:1e-5", "low end of axis clearance = nan is out of range; allowed: a finite number"),
        ("clearance=1e-5:3e-5:4:4", "not of the form"),
        ("clearance=1e-5:3e-5:", "not of the form"),
        ("=clearance=1e-5:3e-5", "not of the form"),
    ],
)
def test_bad_axes_are_refused(text, message):
    """A bad axis names itself and what is allowed."""
    with pytest.raises(ParameterError, match=message):
        Axis.parse(text)


def test_an_axis_with_a_unit_and_no_field_names_the_nearest():
    """It is of the form, so the message is about the field."""
    with pytest.raises(ParameterError, match=r"^axis 'sped' is no field; did you mean speed"):
        Axis.parse("sped=5Hz:30Hz:6", {"excitation_frequency": "Hz"})


def test_an_unknown_scale_is_refused():
    """Steps are even in the value or in its logarithm."""
    with pytest.raises(ParameterError, match="has scale 'sqrt'; allowed: lin, log"):
        Axis("clearance", 1e-5, 3e-5, scale="sqrt")


@pytest.mark.parametrize(
    ("axes", "options", "message"),
    [
        ((Axis("clearence", 1e-5, 3e-5, 2),), {}, "no field"),
        ((Axis("clearance", -1e-5, 3e-5, 2),), {}, r"clearance = -1e-05 m is out of range"),
        ((CLEARANCE, CLEARANCE), {}, "each field once"),
        ((Axis("clearance", 1e-5, 3e-5),), {}, "needs a COUNT"),
        ((CLEARANCE,), {"sampling": "random", "size": 5}, "takes no COUNT"),
        ((Axis("damping_family", 0.0, 1.0, 2),), {}, "is a choice"),
        ((CLEARANCE,), {"budget": 50}, "budget = 50 is out of range"),
        ((CLEARANCE,), {"signals": 1.5}, r"signals = 1.5 is out of range"),
        ((), {"sampling": "crosses", "size": 2}, "axes .none."),
    ],
)
def test_bad_plans_are_refused(axes, options, message):
    """A plan that can't be run is not constructed."""
    with pytest.raises(ParameterError, match=message):
        SweepPlan(PLAIN_BEAM, axes, **options)
