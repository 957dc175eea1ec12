"""The rule of thesis 5.5, on neighbourhoods written down by hand."""

import numpy as np
import pytest

from chaosgym.diagnosis.type_rule import Neighbour, judge_type, type_of_cross, types_on_grid
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
