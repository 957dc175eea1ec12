import json

import numpy as np
import pytest

from chaosgym.diagnosis import (
    Neighbour,
    Tolerance,
    default_tolerances,
    geometric_grid,
    judge_type,
    response_map,
    response_type,
    types_on_grid,
)
from chaosgym.diagnosis.response_map import _neighbour
from chaosgym.diagnosis.stage import lasting_margin
from chaosgym.diagnosis.type_rule import Coexisting
from chaosgym.errors import DiagnosisError, ParameterError
from chaosgym.machines import THESIS_SLIDER_CRANK, ImpactBeam
from tests.plain_modes import PLAIN_BEAM


def around(*points, parameter="clearance"):
    """Neighbours along one parameter from (share, nature, peak)."""
    return [Neighbour({parameter: side}, nature, peak) for side, nature, peak in points]


QUIET = [(-0.5, "periodic", 50.0), (-1, "periodic", 52.0), (0.5, "periodic", 51.0), (0.6, "periodic", 54.9)]


@pytest.mark.parametrize(
    ("nature", "points", "coexisting", "expected"),
    [
        ("periodic", QUIET, (), "I"),
        ("periodic", [*QUIET, (1, "periodic", 55.1)], (), "II"),
        ("periodic", [*QUIET, (-1, "periodic", 20.0)], (), "I"),
        ("periodic", [*QUIET, (1, "chaotic", 50.0)], (), "II"),
        ("periodic", [*QUIET, (1, "undetermined", 50.0)], (), "II"),
        ("periodic", [*QUIET, (0.9, "chaotic", 50.0), (1, "chaotic", 50.0)], (), "II"),
        ("periodic", [*QUIET, (0.55, "chaotic", 50.0)], (), "III"),
        ("periodic", [*QUIET, (1, "chaotic", 50.0), (-1.5, "quasiperiodic", 50.0)], (), "III"),
        ("periodic", QUIET, (("periodic", 50.1), ("periodic", 54.9)), "I"),
        ("periodic", QUIET, (("periodic", 50.1), ("periodic", 44.0)), "III"),
        ("periodic", QUIET, (("chaotic", 50.1),), "III"),
        ("chaotic", QUIET, (), "III"),
        ("quasiperiodic", QUIET, (), "III"),
        ("undetermined", QUIET, (), "undetermined"),
    ],
)
def test_types_follow_their_definition(nature, points, coexisting, expected):
    """The three rules of section 5.5, each at its threshold of 10 %."""
    kind, reason = judge_type(nature, 50.0, around(*points), [Coexisting(*one) for one in coexisting])
    assert kind == expected
    assert reason


def test_chaos_on_both_sides_must_lie_along_one_parameter():
    """Chaos above the clearance and below the speed is Type II, along the same parameter Type III."""
    above, below = (1, "chaotic", 50.0), (-1, "chaotic", 50.0)
    assert judge_type("periodic", 50.0, around(above) + around(below, parameter="speed"))[0] == "II"
    assert judge_type("periodic", 50.0, around(above, below))[0] == "III"


def test_types_on_a_grid():
    """A row of five periodic points beside chaos: two steps away counts, three do not."""
    natures = ["periodic"] * 4 + ["chaotic"]
    assert types_on_grid(natures, [50.0, 51.0, 52.0, 53.0, 60.0]).tolist() == ["I", "I", "II", "II", "III"]
    grid = np.full((5, 5), "periodic", dtype=object)
    grid[1, 2] = grid[3, 2] = "chaotic"
    types = types_on_grid(grid, np.full((5, 5), 50.0))
    assert types[2, 2] == types[1, 2] == "III"
    assert types[2, 1] == "III"  # a periodic point lies between the two chaotic ones beside it
    assert types_on_grid(grid, np.full((5, 5), 50.0), axes=(1,))[2, 2] == "I"
    with pytest.raises(DiagnosisError, match="same shape"):
        types_on_grid(natures, [1.0])


def test_only_damping_constants_and_ratios_have_a_tolerance():
    """The fitted crank has an exponent and base masses of its damping too: no workshop builds them 10 % off."""
    dampings = {name for name in default_tolerances(THESIS_SLIDER_CRANK) if "damping" in name}
    assert dampings == {"damping_ratio", "contact_damping_ratio"}


def test_default_tolerances_cover_speed_clearance_length_and_dampings():
    """+-2 % of the frequency, 5 % of the clearance, 0.1 % of the length, 10 % of each damping."""
    tolerances = default_tolerances(ImpactBeam())
    assert tolerances.keys() == {
        "excitation_frequency",
        "clearance",
        "length",
        "damping_ratio",
        "shaker_damping",
        "contact_damping",
    }
    assert tolerances["excitation_frequency"].at(20.0, 1.0) == pytest.approx(20.4)
    assert Tolerance(10.0, relative=False).at(200.0, -0.5) == 195.0


@pytest.mark.parametrize(("frequency", "expected"), [(8.0, "I"), (19.0, "III"), (30.0, "III")])
def test_types_of_the_beam(frequency, expected):
    """Smooth at 8 Hz, a periodic window at 19 Hz (print: Type III from 16 to 30 Hz), chaotic at 30 Hz."""
    result = response_type(PLAIN_BEAM.at(frequency), window="speed-clearance", budget=400)
    assert result.type == expected
    # 24 from rest, four from states carried along the speed
    assert len(result.neighbours) == (0 if frequency == 30.0 else 28)
    assert json.dumps(result.as_dict())


def test_a_map_agrees_with_single_types_and_shares_runs():
    """On a geometric grid of 4 x 3 points the regions need 56 machines instead of 300."""
    beam = ImpactBeam()
    speeds = geometric_grid(18.6, 19.2, Tolerance(0.02))
    clearances = geometric_grid(0.120e-3, 0.127e-3, Tolerance(0.05))
    assert (len(speeds), len(clearances)) == (4, 3)
    result = response_map(beam, speeds, clearances, budget=400)
    assert result.runs == (4 + 4) * (3 + 4)
    for i, k in ((0, 0), (3, 2)):
        one = ImpactBeam(excitation_frequency=speeds[i], clearance=clearances[k])
        single = response_type(one, window="speed-clearance", initial_states=1, budget=400)
        assert result.type[i, k] == single.type
        assert result.nature[i, k] == single.centre.nature


def test_wrong_requests_are_refused():
    """A window or tolerance that does not exist is named."""
    with pytest.raises(DiagnosisError, match="window"):
        response_type(ImpactBeam(), window="everything")
    with pytest.raises(ParameterError, match="clearence"):
        response_type(ImpactBeam(excitation_frequency=8.0), {"clearence": Tolerance(0.1)}, budget=100)
    with pytest.raises(DiagnosisError, match="initial_states"):
        response_type(ImpactBeam(), initial_states=7)


def test_the_definition_of_the_window_is_part_of_the_label():
    """A wide window at 16.5 Hz reaches what a narrow one does not."""
    narrow = {"excitation_frequency": Tolerance(0.001)}
    wide = {"excitation_frequency": Tolerance(0.2)}
    beam = PLAIN_BEAM.at(16.5)
    kinds = [response_type(beam, tolerances, initial_states=1, budget=400).type for tolerances in (narrow, wide)]
    assert kinds[0] != kinds[1]
    assert (
        response_type(beam, narrow, start="continuation", initial_states=1, budget=400).definition["start"]
        == "continuation"
    )


def test_a_point_that_could_not_be_run_is_undetermined():
    """Its neighbours are judged without it."""
    told = _neighbour({"speed": 0.5}, None, ())
    assert (told.shares, told.nature) == ({"speed": 0.5}, "undetermined")
    assert np.isnan(told.largest_peak)


@pytest.mark.parametrize(("cycles", "margin"), [(1, 0.0), (10**9, 1.0)])
def test_the_margin_of_lasting_chaos_is_a_share(cycles, margin):
    """However few cycles were seen, and however many."""
    assert lasting_margin(cycles) == margin


def test_tolerances_of_a_crank_are_in_rpm_and_of_a_beam_a_share():
    """Ten turns a minute, or two per cent."""
    assert default_tolerances(THESIS_SLIDER_CRANK)["crank_speed"] == Tolerance(10.0, relative=False)
    assert default_tolerances(ImpactBeam())["excitation_frequency"] == Tolerance(0.02)
