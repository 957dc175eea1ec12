import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym.branches.bifurcation import _changes
from chaosgym.branches.coexistence import coexistence
from chaosgym.branches.diagram_search import follow
from chaosgym.branches.margins import margins
from chaosgym.cli import app
from chaosgym.diagnosis import Tolerance, diagnose, find_periodic_orbit
from chaosgym.errors import DiagnosisError
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate
from tests.branches.test_branch import SOFT, oscillator
from tests.plain_modes import HARD_BEAM


def orbit_of(machine):
    """Orbit on which a machine settles from rest."""
    verdict = diagnose(machine)
    return find_periodic_orbit(machine, verdict.evidence["final_state"], verdict.period)


def dragged(machine, state, field, values):
    """State of a machine whose field moves slowly through some values."""
    for value in values:
        state = simulate(with_settings(machine, {field: value}), 40, state).final_state.coordinates
    return state


@pytest.mark.parametrize(("field", "side"), [("excitation_frequency", -1), ("clearance", 1)])
def test_a_fold_is_where_the_dragged_motion_jumps(field, side):
    """A beam on a hard pivot, 19 Hz: its motion follows a field up to the margin, and jumps within 0.02 % more."""
    beam = replace(HARD_BEAM, excitation_frequency=19.0)
    orbit = orbit_of(beam)
    found = margins(beam, orbit, {field: Tolerance(0.02 if field == "excitation_frequency" else 0.05)})
    (end,) = [margin for margin in found.margins if margin.side == side]
    assert end.kind == "fold"
    assert 0.5 < end.share < 1.0
    nominal = getattr(beam, field)
    inside, outside = (end.value * (1.0 - side * share) for share in (1e-4, -1e-4))
    near = dragged(beam, orbit.state, field, np.linspace(nominal, inside, 60))
    far = dragged(beam, near, field, [outside] * 10)
    peaks = [
        simulate(with_settings(beam, {field: value}), 1, state).peak_force.max()
        for value, state in ((inside, near), (outside, near), (outside, far))
    ]
    assert peaks[1] == pytest.approx(peaks[0], rel=2e-3)
    assert peaks[2] != pytest.approx(peaks[0], rel=5e-3)


def test_a_doubled_motion_ends_where_it_began():
    """Between two flips the soft stop has period 12: it ends at the flip of its parent, and flips at its own."""
    diagram = follow(SOFT, "speed", (0.3855, 0.389), sweep=2, workers=1, longest_period=12)
    (first, _), (second, _) = (
        (one.value, one.period) for one in diagram.bifurcations if one.kind == "flip" and not one.ends
    )
    machine = with_settings(SOFT, {"speed": 0.5 * (first + second)})
    settled = simulate(machine, 1, transient=6000).final_state
    orbit = find_periodic_orbit(machine, settled, 12)
    below, above = margins(machine, orbit, {"speed": Tolerance(0.01)}).margins
    assert (below.kind, above.kind) == ("flip", "flip")
    assert (below.value, above.value) == pytest.approx((first, second), rel=1e-7)


def test_nothing_is_near_a_calm_orbit():
    """A linear response away from the stop keeps its stability throughout; its multiplier is that of the damping."""
    machine = oscillator(damping=0.05, stiffness=50.0, gap=9.0, speed=0.08)
    orbit = orbit_of(machine)
    found = margins(machine, orbit)
    assert found.nearest is None
    assert [margin.share for margin in found.margins] == pytest.approx([1.0] * len(found.margins))
    assert found.largest_multiplier == pytest.approx(np.exp(-0.05 / 0.08), rel=1e-9)


def test_the_other_motion_and_where_both_end_are_told():
    """Between its folds an oscillator flies free or hits its stop; a knock leads from one to the other."""
    speed = 0.238
    machine = oscillator(damping=0.02, stiffness=30.0, contact_damping=0.5, speed=speed, force=1.2, stops="one")
    rate = 2.0 * np.pi * speed
    response = 1.2 / complex(1.0 - rate**2, 0.04 * rate)
    orbit = find_periodic_orbit(machine, [response.imag, rate * response.real], 1)
    assert orbit is not None
    assert simulate(machine, 1, orbit.state).peak_force.max() == 0.0
    found = margins(machine, orbit, {"speed": Tolerance(0.05)})
    (below, above) = found.margins
    assert below.kind in ("grazing", "fold")
    assert below.value == pytest.approx(0.23598, abs=1e-4)
    assert above.kind is None
    verdict = diagnose(machine, initial_state=orbit.state)
    beside = coexistence(machine, verdict, knocks=60, workers=1)
    _, other = beside.attractors.motions
    assert other.nature == "periodic"
    assert other.largest_peak > 0.0
    assert beside.shock is not None
    assert beside.shock.leads_to == 1
    flight, rattle = beside.spans
    assert flight is not None
    assert flight.below.speed == pytest.approx(below.value, rel=1e-9)
    assert rattle is not None
    dragged_on = dragged(machine, other.state, "speed", np.linspace(speed, rattle.above.speed * (1.0 - 1e-4), 60))
    near, beyond = (rattle.above.speed * (1.0 + side * 1e-4) for side in (-1.0, 1.0))
    assert simulate(with_settings(machine, {"speed": near}), 1, dragged_on).peak_force.max() > 0.0
    fallen = dragged(machine, dragged_on, "speed", [beyond] * 40)
    assert simulate(with_settings(machine, {"speed": beyond}), 1, fallen).peak_force.max() == 0.0


def test_an_orbit_that_repels_has_no_margin():
    """Margins are those of a certified orbit."""
    machine = oscillator(damping=0.02, stiffness=30.0, contact_damping=0.5, speed=0.08, gap=10.0)
    orbit = orbit_of(machine)
    with pytest.raises(DiagnosisError, match="reach = 0 tolerances is out of range; allowed: above 0"):
        margins(machine, orbit, reach=0.0)
    with pytest.raises(DiagnosisError, match="need a periodic orbit that is certified"):
        margins(machine, replace(orbit, residual=1.0))


def answer(*words):
    """JSON object of a command that must succeed."""
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_commands_print_margins_and_branches(tmp_path):
    """``diagnose --margins`` and ``branch`` in JSON; a chaotic response has no margins, and says so."""
    machine = tmp_path / "soft.toml"
    machine.write_text(
        '[structure]\nfrequencies = "1 Hz"\ndamping_ratios = "2 %"\n[structure.shapes]\nmass = "1 kg^-1/2"\n'
        '[joint]\nat = "mass"\nclearance = "0 mm"\nstops = "one"\nstiffness = "1184 N/m"\ndamping = "3.14 N s/m"\n'
        '[[drive]]\nat = "mass"\nforce = "1 N"\n'
        '[operation]\nspeed = "2.3 Hz"\nspeed_range = "2 to 3 Hz"\nclearance_range = "0 to 10 mm"\n'
        '[tolerances]\nspeed = "10 %"\n'
    )
    found = answer("diagnose", str(machine), "--margins")["margins"]
    assert 0.0 < found["largest_multiplier"] < 1.0
    (flip,) = [one["value"] for one in found["margins"] if one["kind"] == "flip"]
    table = tmp_path / "orbits.csv"
    words = ("branch", str(machine), "--along", "speed=2.2:2.6 Hz:5", "--workers", "1", "--out", str(table))
    diagram = answer(*words)
    flips = [one for branch in diagram["branches"] for one in branch["bifurcations"] if one["kind"] == "flip"]
    assert min(abs(one["value"] - flip) for one in flips) < 1e-7
    assert table.read_text().startswith('"branch","period","speed","kind"')
    chaotic = CliRunner().invoke(app, ["diagnose", "impact-beam", "--budget", "100", "--margins"])
    assert "no margins: they need an orbit that is proven to attract, this response is chaotic" in chaotic.output


@pytest.mark.parametrize(
    ("crossed", "changes"),
    [((), {0}), (("one",), {-1, 1}), (("circle",), {-2, 0, 2}), (("one", "minus one"), {-2, 0, 2})],
)
def test_multipliers_that_cross_explain_a_change_of_stability(crossed, changes):
    """One real multiplier is one more or one fewer, a pair two, or none where two real ones only change places."""
    assert _changes({name: name in crossed for name in ("one", "minus one", "circle")}) == changes
