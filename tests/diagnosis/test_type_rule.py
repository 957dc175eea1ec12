"""The rule of thesis 5.5, on neighbourhoods written down by hand."""

import numpy as np
import pytest
from scipy.optimize import linprog

from chaosgym.diagnosis.type_rule import (
    UNSETTLED,
    Coexisting,
    Neighbour,
    judge_type,
    mixed,
    type_of_cross,
    types_on_grid,
)
from chaosgym.errors import DiagnosisError

CALM_THROUGHOUT = "periodic throughout the tolerances, peak force less than 10 % higher"
CALM = [Neighbour({name: side}, "periodic", 100.0) for name in ("speed", "clearance") for side in (-1, 1)]


def _with(*changed):
    """The calm neighbourhood with some points replaced."""
    kept = {point.place: point for point in CALM}
    return list((kept | {point.place: point for point in changed}).values())


def motion(peak, nature="periodic"):
    """Another motion of the same machine."""
    return Coexisting(nature, peak)


@pytest.mark.parametrize(
    ("nature", "neighbours", "coexisting", "expected", "reason"),
    [
        ("periodic", CALM, (), "I", CALM_THROUGHOUT),
        ("undetermined", CALM, (), "undetermined", "the nominal response is undetermined"),
        ("chaotic", CALM, (), "III", "the nominal response is chaotic"),
        ("quasiperiodic", CALM, (), "III", "the nominal response is quasiperiodic"),
        ("periodic", _with(Neighbour({"speed": 1}, "chaotic", 100.0)), (), "II", "chaotic above the nominal speed"),
        ("periodic", _with(Neighbour({"speed": -1}, "chaotic", 100.0)), (), "II", "chaotic below the nominal speed"),
        (
            "periodic",
            _with(Neighbour({"speed": -1}, "chaotic", 1.0), Neighbour({"clearance": 1}, "chaotic", 1.0)),
            (),
            "II",
            "chaotic below the nominal speed",
        ),
        (
            "periodic",
            _with(Neighbour({"clearance": -1}, "chaotic", 1.0), Neighbour({"clearance": 1}, "undetermined", 1.0)),
            (),
            "III",
            "2 of 5 points in the tolerances are not periodic (1 undetermined), mixed with periodic ones",
        ),
        ("periodic", _with(Neighbour({"speed": 1}, "periodic", 110.0)), (), "I", CALM_THROUGHOUT),
        (
            "periodic",
            _with(Neighbour({"speed": 1}, "periodic", 112.0)),
            (),
            "II",
            "peak force 12% higher above the nominal speed",
        ),
        (
            "periodic",
            _with(Neighbour({"speed": -1}, "periodic", 120.0)),
            (),
            "II",
            "peak force 20% higher below the nominal speed",
        ),
        ("periodic", CALM, (motion(110.0), motion(91.0)), "I", CALM_THROUGHOUT),
        (
            "periodic",
            CALM,
            (motion(100.0), motion(111.0)),
            "III",
            "another initial state leads to 111 N instead of 100 N",
        ),
        ("periodic", CALM, (motion(90.0),), "III", "another initial state leads to 90 N instead of 100 N"),
        (
            "periodic",
            CALM,
            (motion(100.0, "chaotic"),),
            "III",
            "another initial state leads to a chaotic motion, up to 100 N",
        ),
        (
            "periodic",
            CALM,
            (motion(float("nan"), UNSETTLED),),
            "undetermined",
            "other initial states do not settle within the budget",
        ),
        (
            "periodic",
            CALM,
            (motion(float("nan"), UNSETTLED), motion(111.0)),
            "III",
            "another initial state leads to 111 N instead of 100 N",
        ),
    ],
)
def test_types_of_written_neighbourhoods(nature, neighbours, coexisting, expected, reason):
    """A change of more than 10 % or of nature on one side is II, on both sides of one parameter III (thesis 5.5.1)."""
    assert judge_type(nature, 100.0, neighbours, coexisting) == (expected, reason)


def test_a_tenth_more_is_not_more_than_a_tenth():
    """At the threshold itself the force does not matter; above it does, however small the force is."""
    assert judge_type("periodic", 10.0, [Neighbour({"speed": 1}, "periodic", 11.0)])[0] == "I"
    kind, why = judge_type("periodic", 0.5, [Neighbour({"speed": 1}, "periodic", 1.0)])
    assert (kind, why) == ("II", "peak force 100% higher above the nominal speed")


def test_a_contact_that_only_a_neighbour_has_is_infinitely_higher():
    """No force at the centre, some beside it."""
    kind, why = judge_type("periodic", 0.0, [Neighbour({"speed": 1}, "periodic", 3.0)])
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
    assert types_on_grid(natures, peaks).tolist() == [["I", "I", "I", "II", "III", "III", "III"]]
    assert types_on_grid(natures, peaks, reach=1).tolist() == [["I", "I", "I", "I", "II", "III", "II"]]
    assert types_on_grid(natures, peaks, axes=[1], reach=[1]).tolist() == [["I", "I", "I", "I", "II", "III", "II"]]
    assert types_on_grid(natures, peaks, axes=[0]).tolist() == [["I", "I", "I", "I", "I", "III", "I"]]
    with pytest.raises(DiagnosisError, match="same shape"):
        types_on_grid(natures, peaks[0])
    with pytest.raises(ValueError, match="shorter"):
        types_on_grid(natures, peaks, reach=[1])


def test_a_corner_of_a_grid_counts():
    """Chaos diagonally beside a point lies within its tolerances; a diagonal edge of chaos is no mixture."""
    natures = np.array([["p", "p", "p", "C"], ["p", "p", "p", "p"], ["C", "p", "p", "p"], ["C", "C", "p", "p"]])
    natures = np.where(natures == "C", "chaotic", "periodic")
    expected = [
        ["I", "I", "II", "III"],
        ["II", "II", "II", "II"],
        ["III", "II", "II", "I"],
        ["III", "III", "II", "I"],
    ]
    assert types_on_grid(natures, np.ones((4, 4)), reach=1).tolist() == expected
    assert types_on_grid(["periodic"] * 3, [100.0, 120.0, 100.0]).tolist() == ["II", "I", "II"]


def test_a_window_in_chaos_is_type_iii():
    """P C P on one side of a point: along a line the nature changes twice within the tolerances (case III)."""
    natures = ["periodic", "periodic", "chaotic", "periodic", "periodic"]
    assert types_on_grid(natures, [100.0] * 5).tolist() == ["II", "III", "III", "III", "II"]


def machines(*natures, peak=100.0):
    """Machines of a region with speed and clearance above and below nominal, in turn."""
    corners = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
    return [
        Neighbour(dict(zip(("speed", "gap"), corner, strict=True)), nature, peak)
        for corner, nature in zip(corners, natures, strict=True)
    ]


def test_machines_that_mix_with_periodic_ones_make_type_iii():
    """Two opposite corners of the region hold the nominal machine between them (thesis 5.5.1, case III)."""
    kind, why = judge_type("periodic", 100.0, CALM + machines("chaotic", "periodic", "periodic", "undetermined"))
    assert kind == "III"
    assert why == "2 of 9 points in the tolerances are not periodic (1 undetermined), mixed with periodic ones"


def test_machines_that_are_not_periodic_on_one_side_make_type_ii():
    """Chaos at high speed alone fills a part of the region, beside which the nominal machine lies (case II)."""
    fast = [point._replace(nature="chaotic") if point.shares.get("speed") == 1 else point for point in CALM]
    kind, why = judge_type("periodic", 100.0, fast + machines("chaotic", "periodic", "chaotic", "periodic"))
    assert (kind, why) == ("II", "chaotic above the nominal speed")
    assert judge_type("periodic", 100.0, CALM + machines("chaotic", "periodic", "chaotic", "periodic"))[0] == "III"


def test_no_machine_of_the_region_is_overlooked():
    """Whatever the one-parameter neighbours do, one machine off its period or 10 % higher is no Type I."""
    assert judge_type("periodic", 100.0, CALM + machines(*["periodic"] * 4))[0] == "I"
    for odd in range(4):
        natures = ["periodic"] * 4
        natures[odd] = "undetermined"
        kind, why = judge_type("periodic", 100.0, CALM + machines(*natures))
        assert (kind, why) == ("II", "1 of 9 points in the tolerances is not periodic (1 undetermined)")
    kind, why = judge_type("periodic", 100.0, CALM + machines(*["periodic"] * 4, peak=111.0))
    assert (kind, why) == ("II", "peak force 11% higher above the nominal speed and above the nominal gap")


def test_mixed_points_are_those_that_no_plane_parts():
    """Random sets of points, against the search for the plane itself: w and b with w p + b > 1 and < -1."""
    rng = np.random.default_rng(2)
    told = []
    for _ in range(60):
        some = rng.uniform(-1.0, 1.0, (rng.integers(1, 9), 3)) + rng.uniform(0.0, 1.2, 3)
        others = rng.uniform(-1.0, 1.0, (rng.integers(1, 9), 3))
        rows = np.vstack([-np.c_[some, np.ones(len(some))], np.c_[others, np.ones(len(others))]])
        plane = linprog(np.zeros(4), A_ub=rows, b_ub=-np.ones(len(rows)), bounds=(None, None))
        told.append(mixed(*[[dict(zip("xyz", p, strict=True)) for p in points] for points in (some, others)]))
        assert told[-1] == (plane.status == 2)
    assert 10 < sum(told) < 50
