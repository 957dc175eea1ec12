"""The rule of thesis 5.5, on neighbourhoods written down by hand."""

import numpy as np
import pytest
from scipy.optimize import linprog

from chaosgym.diagnosis.type_rule import Built, Neighbour, judge_type, surrounded, type_of_cross, types_on_grid
from chaosgym.errors import DiagnosisError

CALM_THROUGHOUT = "periodic throughout the neighbourhood, peak force less than 10 % higher"
CALM = [Neighbour(name, side, "periodic", 100.0) for name in ("speed", "clearance") for side in (-1, 1)]


def _with(*changed):
    """The calm neighbourhood with some points replaced."""
    kept = {(point.parameter, point.side): point for point in CALM}
    return list((kept | {(point.parameter, point.side): point for point in changed}).values())


@pytest.mark.parametrize(
    ("nature", "neighbours", "coexisting", "expected", "reason"),
    [
        ("periodic", CALM, (), "I", CALM_THROUGHOUT),
        ("undetermined", CALM, (), "undetermined", "the nominal response is undetermined"),
        ("chaotic", CALM, (), "III", "the nominal response is chaotic"),
        ("quasiperiodic", CALM, (), "III", "the nominal response is quasiperiodic"),
        ("periodic", _with(Neighbour("speed", 1, "chaotic", 100.0)), (), "II", "chaotic above the nominal speed"),
        ("periodic", _with(Neighbour("speed", -1, "chaotic", 100.0)), (), "II", "chaotic below the nominal speed"),
        (
            "periodic",
            _with(Neighbour("speed", -1, "chaotic", 1.0), Neighbour("clearance", 1, "chaotic", 1.0)),
            (),
            "II",
            "chaotic below the nominal speed",
        ),
        (
            "periodic",
            _with(Neighbour("clearance", -1, "chaotic", 1.0), Neighbour("clearance", 1, "undetermined", 1.0)),
            (),
            "III",
            "not periodic on both sides along clearance",
        ),
        ("periodic", _with(Neighbour("speed", 1, "periodic", 110.0)), (), "I", CALM_THROUGHOUT),
        (
            "periodic",
            _with(Neighbour("speed", 1, "periodic", 112.0)),
            (),
            "II",
            "peak force 12% higher above the nominal speed",
        ),
        (
            "periodic",
            _with(Neighbour("speed", -1, "periodic", 120.0)),
            (),
            "II",
            "peak force 20% higher below the nominal speed",
        ),
        ("periodic", CALM, (110.0, 91.0), "I", CALM_THROUGHOUT),
        ("periodic", CALM, (100.0, 111.0), "III", "another initial state leads to 111 N instead of 100 N"),
        ("periodic", CALM, (90.0,), "III", "another initial state leads to 90 N instead of 100 N"),
    ],
)
def test_types_of_written_neighbourhoods(nature, neighbours, coexisting, expected, reason):
    """A change of more than 10 % or of nature on one side is II, on both sides of one parameter III."""
    assert judge_type(nature, 100.0, neighbours, coexisting) == (expected, reason)


def test_a_tenth_more_is_not_more_than_a_tenth():
    """At the threshold itself the force does not matter; above it does, however small the force is."""
    assert judge_type("periodic", 10.0, [Neighbour("speed", 1, "periodic", 11.0)])[0] == "I"
    kind, why = judge_type("periodic", 0.5, [Neighbour("speed", 1, "periodic", 1.0)])
    assert (kind, why) == ("II", "peak force 100% higher above the nominal speed")


def test_a_contact_that_only_a_neighbour_has_is_infinitely_higher():
    """No force at the centre, some beside it."""
    kind, why = judge_type("periodic", 0.0, [Neighbour("speed", 1, "periodic", 3.0)])
    assert (kind, why) == ("II", "peak force inf% higher above the nominal speed")


def test_a_cross_names_its_fields():
    """Order: centre, slower, faster, tighter, wider."""
    natures = ["periodic"] * 5
    assert type_of_cross(natures, [100.0, 100.0, 100.0, 100.0, 120.0])[1].endswith(
        "20% higher above the nominal clearance"
    )
    assert type_of_cross(natures, [120.0, 100.0, 120.0, 120.0, 120.0])[0] == "I"
    with pytest.raises(ValueError, match="shorter"):
        type_of_cross(natures[:4], [1.0] * 5)
    kind, why = type_of_cross([*natures[:1], "chaotic", *natures[2:]], [1.0] * 5, ("crank speed", "gap"))
    assert (kind, why) == ("II", "chaotic below the nominal crank speed")


def test_a_grid_is_judged_over_its_reach():
    """Chaos two columns away counts within a reach of two and not of one; axes that are left out do not count."""
    natures = np.full((1, 7), "periodic", dtype=object)
    natures[0, 5] = "chaotic"
    peaks = np.full((1, 7), 100.0)
    assert types_on_grid(natures, peaks).tolist() == [["I", "I", "I", "II", "II", "III", "II"]]
    assert types_on_grid(natures, peaks, reach=1).tolist() == [["I", "I", "I", "I", "II", "III", "II"]]
    assert types_on_grid(natures, peaks, axes=[1], reach=[1]).tolist() == [["I", "I", "I", "I", "II", "III", "II"]]
    assert types_on_grid(natures, peaks, axes=[0]).tolist() == [["I", "I", "I", "I", "I", "III", "I"]]
    with pytest.raises(DiagnosisError, match="same shape"):
        types_on_grid(natures, peaks[0])
    with pytest.raises(ValueError, match="shorter"):
        types_on_grid(natures, peaks, reach=[1])


def test_each_axis_of_a_grid_has_two_sides():
    """Chaos above and below is III; above and to the right, which are two parameters, is II, also in the corners."""
    natures = np.array([["p", "C", "p", "p"], ["p", "p", "C", "p"], ["C", "C", "p", "p"]])
    natures = np.where(natures == "C", "chaotic", "periodic")
    expected = [["II", "III", "II", "I"], ["II", "III", "III", "II"], ["III", "III", "II", "I"]]
    assert types_on_grid(natures, np.ones((3, 4)), reach=1).tolist() == expected
    assert types_on_grid(["periodic"] * 3, [100.0, 120.0, 100.0]).tolist() == ["II", "I", "II"]


def machines(*natures, peak=100.0):
    """Machines of a region with speed and clearance above and below nominal, in turn."""
    corners = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
    return [
        Built(dict(zip(("speed", "gap"), corner, strict=True)), nature, peak)
        for corner, nature in zip(corners, natures, strict=True)
    ]


def test_machines_that_are_not_periodic_on_all_sides_make_type_iii():
    """Two opposite corners of the region hold the nominal machine between them (thesis 5.5.1, case III)."""
    kind, why = judge_type("periodic", 100.0, CALM, built=machines("chaotic", "periodic", "periodic", "undetermined"))
    assert kind == "III"
    assert why == "2 of 4 machines in the tolerances are not periodic (1 undetermined), on all sides of the nominal one"


def test_machines_that_are_not_periodic_on_one_side_make_type_ii():
    """Chaos at high speed alone fills a part of the region, beside which the nominal machine lies (case II)."""
    assert judge_type("periodic", 100.0, CALM, built=machines("chaotic", "periodic", "chaotic", "periodic"))[0] == "II"


def test_no_machine_of_the_region_is_overlooked():
    """Whatever the one-parameter neighbours do, one machine off its period or 10 % higher is no Type I."""
    assert judge_type("periodic", 100.0, CALM, built=machines(*["periodic"] * 4))[0] == "I"
    for odd in range(4):
        natures = ["periodic"] * 4
        natures[odd] = "undetermined"
        assert judge_type("periodic", 100.0, CALM, built=machines(*natures))[0] == "II"
    assert judge_type("periodic", 100.0, CALM, built=machines(*["periodic"] * 4, peak=111.0))[0] == "II"


def test_a_hull_is_that_of_a_linear_program():
    """Whether random points surround the origin, against scipy's linear programming."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        places = rng.uniform(-1.0, 1.0, (rng.integers(1, 12), 3)) + rng.uniform(-0.5, 0.5, 3)
        equal = np.vstack([places.T, np.ones(len(places))])
        feasible = linprog(np.zeros(len(places)), A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0]).status == 0
        assert surrounded([dict(zip("xyz", place, strict=True)) for place in places]) == feasible
