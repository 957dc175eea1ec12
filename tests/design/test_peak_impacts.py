"""Peak Impact Diagrams: where impacts act, when the diagram has taken shape, and what spreading them is worth."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from chaosgym import Drive, ModalMachine, Structure
from chaosgym.design.brief import brief_from
from chaosgym.design.peak_impacts import PeakImpactDiagram, coverage, filling_cycles, peak_impacts, worn_side
from chaosgym.design.statistics import convergence
from chaosgym.design.trends import DIAGRAM_CYCLES, HISTORY_SAMPLES, impacts_against, life_against
from chaosgym.errors import DesignError, ParameterError, SimulationError
from chaosgym.machines import MACHINES, ImpactBeam
from chaosgym.machines.parameters import with_settings
from chaosgym.plotting.design import impact_diagram
from chaosgym.simulation import simulate
from tests.machines.kinematics import slider_position
from tests.plain_modes import HARD_BEAM


def test_clearance_trades_force_against_spread():
    """Thesis 5.4.1: with more clearance peaks grow; on the chaotic beam they spread, on the periodic one they do not.

    Force and spread are those of a run of its own, and the lines name the clearance in its unit.
    """
    beam = ImpactBeam(excitation_frequency=30.0)
    found = impacts_against(beam, [0.03175e-3, 0.127e-3])
    assert found[1].force > found[0].force
    assert found[1].spread > 10.0 > found[0].spread
    at = replace(beam, clearance=0.127e-3)
    record = simulate(at, DIAGRAM_CYCLES, transient=DIAGRAM_CYCLES, samples_per_cycle=HISTORY_SAMPLES)
    assert found[1].spread == peak_impacts(record, worn_side(record)).spread
    assert found[1].largest_peak == record.peak_force.max()
    assert found[0].told(beam).startswith("at clearance 0.03175 mm: equivalent ")


@pytest.mark.parametrize("given", ["[]", "3", '["0.1 kg"]', '["-1 mm"]', '"0.1 mm"', "[0.1]"])
def test_clearances_that_are_none_are_one_line(given):
    """A list of clearances, each with a unit and within its range; the section has no other key."""
    head = 'machine = "impact-beam"\n[criteria]\nload_rating = "5 N"\nlife = "1 h"\nreliability = 0.9\n[impacts]\n'
    with pytest.raises((DesignError, ParameterError), match="clearance") as caught:
        brief_from(tomllib.loads(f"{head}clearances = {given}"))
    assert "\n" not in str(caught.value)
    with pytest.raises(DesignError, match="did you mean clearances"):
        brief_from(tomllib.loads(f'{head}clearancess = ["1 mm"]'))
    assert brief_from(tomllib.loads(f'{head}clearances = ["1 mm", "0.5 mm"]')).impacts == (1e-3, 0.5e-3)


def test_a_periodic_response_gives_one_point():
    """All impacts in one place, with the record's own peak forces."""
    record = simulate(ImpactBeam(excitation_frequency=10.0), 30, transient=100, samples_per_cycle=1000)
    diagram = peak_impacts(record, 0)
    assert diagram.spread < 1.0
    assert diagram.unit == "deg of the cycle"
    assert np.array_equal(diagram.force, record.peak_force[:, 0])
    assert filling_cycles(diagram) == 2


def test_a_chaotic_response_spreads():
    """On a hard pivot at 30 Hz the instants of the peaks spread over tens of degrees."""
    record = simulate(HARD_BEAM, 100, transient=100, samples_per_cycle=1000)
    assert peak_impacts(record, 0).spread > 20.0


def test_a_contact_that_stays_needs_a_time_history():
    """Only its samples tell when peaks act."""
    with pytest.raises(SimulationError, match="samples_per_cycle"):
        peak_impacts(simulate(ImpactBeam(), 5))


def test_coverage_of_equal_sections_is_that_of_good_and_turing():
    """Two sections hit in turn: no impact is new from the fourth on, and the estimate says so."""
    diagram = PeakImpactDiagram(np.tile([0.0, 1.0], 5), np.full(10, 50.0), "m")
    assert coverage(diagram)[:4] == pytest.approx([0.0, 0.0, 1.0 - 1.0 / 3.0, 1.0])
    assert filling_cycles(diagram) == 4
    scattered = PeakImpactDiagram(np.arange(5.0), np.arange(5.0), "m")
    assert filling_cycles(scattered) is None


def test_coverage_foresees_the_share_of_impacts_in_known_sections():
    """Over 20 random diagrams the mean estimate after 60 impacts is the share of later ones in visited sections."""
    estimates, shares = [], []
    for seed in range(20):
        random = np.random.default_rng(seed)
        location, force = random.normal(size=4000), random.normal(50.0, 5.0, 4000)
        estimates.append(coverage(PeakImpactDiagram(location, force, "m"))[59])
        section = [np.minimum((v - v.min()) / np.ptp(v) * 5, 4).astype(int) for v in (location, force)]
        cell = section[0] * 5 + section[1]
        shares.append(np.isin(cell[60:], cell[:60]).mean())
    assert np.mean(estimates) == pytest.approx(np.mean(shares), abs=0.03)


@pytest.mark.parametrize("side", [0, 1])
def test_slider_crank_fills_its_diagram_within_eighty_cycles(side):
    """Figures 5.13 and 5.14, 190 rpm and +-0.254 mm: the diagram takes shape within the 80 cycles of the thesis.

    One stretch of chaos is luck: the median of six must do so.
    """
    crank = with_settings(MACHINES["slider-crank"](), {"crank_speed": 190.0, "slider_clearance": 0.254e-3})
    record = simulate(crank, 1800, transient=60)
    diagrams = [peak_impacts(record.after(k).until(300), side) for k in range(0, 1800, 300)]
    for diagram in diagrams:
        assert diagram.unit == "m"
        assert 0.0 < diagram.spread < 0.101
    assert 10 <= np.median([filling_cycles(diagram) or np.inf for diagram in diagrams]) <= 80
    assert 5 <= max(convergence(diagram.force).cycles for diagram in diagrams) <= 80


def test_the_place_of_a_sliding_peak_is_where_its_history_has_it():
    """The slider's place at the recorded instant agrees with the crest of a fine time history, to its resolution."""
    crank = with_settings(MACHINES["slider-crank"](), {"crank_speed": 190.0, "slider_clearance": 0.254e-3})
    samples = 7200
    record = simulate(crank, 3, transient=20, samples_per_cycle=samples)
    for side, sign in ((0, 1.0), (1, -1.0)):
        at = 2.0 * np.pi / samples * np.argmax(sign * record.history[:, :, 2], axis=1)
        assert record.peak_phase[:, side] == pytest.approx(at, abs=2.0 * np.pi / samples)
        diagram = peak_impacts(record, side)
        expected = slider_position(at, crank.crank_radius, crank.rod_length, 0.0)
        assert diagram.location == pytest.approx(expected, abs=5e-5)
        assert np.array_equal(diagram.force, record.peak_force[:, side])


BALL = {
    "slider_joint": "ideal",
    "ball_joint": "spherical",
    "gravity": 9.81,
    "rod": "rigid",
    "matrix_update_interval": 5.0,
}


def ball(**settings):
    """The crank with clearance at the ball joint alone, upright."""
    return with_settings(MACHINES["slider-crank"](), BALL | settings)


@pytest.mark.parametrize("model", ["spherical", "instrumented"])
def test_a_ball_joint_is_struck_at_polar_angles(model):
    """A force's components make up its size, and the diagram shows their angle on the housing, not the phase."""
    record = simulate(ball(ball_joint=model, crank_speed=120.0), 40, transient=20)
    assert np.linalg.norm(record.peak_vector, axis=2) == pytest.approx(record.peak_force, rel=1e-9)
    assert np.all(record.peak_vector[:, 0, 1] > 0.0)
    diagram = peak_impacts(record)
    assert diagram.unit == "deg"
    assert np.array_equal(diagram.force, record.peak_force.max(axis=1))
    largest = int(np.argmax(diagram.force))
    along, across, _ = record.peak_vector[largest, np.argmax(record.peak_force[largest])]
    turns = (diagram.location[largest] - np.degrees(np.arctan2(across, along))) / 360.0
    assert turns == pytest.approx(round(turns), abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 25.0])
def test_impacts_lean_out_of_the_plane_only_at_a_motor_angle(angle):
    """At 25 deg and 120 rpm the ball strikes the housing up to tens of degrees beside the plane of swing."""
    diagram = peak_impacts(simulate(ball(crank_speed=120.0, motor_angle=angle), 10, transient=10))
    if angle == 0.0:
        assert diagram.elevation is None
    else:
        assert 10.0 < np.abs(diagram.elevation).max() < 60.0
    ax = impact_diagram(diagram, Figure().add_subplot())
    assert ax.get_xlabel() == "polar angle on the bearing [deg]"
    assert (len(ax.figure.axes) == 2) == (angle > 0.0)


def test_slow_cranking_presses_the_housing_from_above():
    """At 2 rpm weight alone acts: the ball carries the housing, and the peak pushes up and along the upright rod."""
    record = simulate(ball(crank_speed=2.0), 1, transient=1)
    along, up, sideways = record.peak_vector[0, 0]
    assert up > 0.95 * record.peak_force[0, 0]
    assert abs(along) < 0.3 * up
    assert sideways == 0.0


def test_larger_clearance_spreads_ball_impacts_over_half_the_bearing():
    """Figure 5.10 b, 110 rpm and +-0.254 mm: almost half of the bearing (180 deg); here half, 150 to 210 deg.

    Figure 5.10 a prints 30 deg at 120 rpm and +-0.064 mm; here the peaks lie in two places half a turn apart, half
    of them in each.
    """
    wide = peak_impacts(simulate(ball(crank_speed=110.0, ball_clearance=0.254e-3), 100, transient=40))
    assert 150.0 < wide.spread < 210.0
    narrow = peak_impacts(simulate(ball(crank_speed=120.0, ball_clearance=0.0635e-3), 100, transient=40))
    count, _ = np.histogram(narrow.location, bins=np.arange(-60.0, 301.0, 30.0))
    assert 0.4 < count.max() / count.sum() < 0.6


def test_life_against_speed_is_one_at_its_reference_and_scattered_in_chaos():
    """Figure 5.12: periodic speeds have one life, chaotic ones a range around the statistical mean."""
    trend = life_against(ImpactBeam(), "excitation_frequency", [6.0, 12.0, 30.0])
    assert trend.statistical[0] == pytest.approx(1.0)
    assert trend.nature == ("periodic", "periodic", "chaotic")
    assert trend.highest[1] == pytest.approx(trend.lowest[1], rel=1e-3)
    assert trend.highest[2] > 2.0 * trend.lowest[2]
    assert trend.lowest[2] < trend.statistical[2] < trend.highest[2]


def test_life_against_speed_starts_where_there_is_contact_and_finds_the_speeds_without():
    """Of one mode at 20 Hz: where twice the linear amplitude stays in the gap, life is unlimited; in it, life ends."""
    structure = Structure.of_matrices(np.eye(1), np.array([[(40.0 * np.pi) ** 2]]), 0.05, {"tip": 0}, modes=1)
    drives = (Drive.sine("force", "tip", 2.0),)
    joint = {"contact_stiffness": 1e6, "contact_damping": 20.0, "clearance": 0.4e-3}
    machine = ModalMachine(modes=structure, joint="tip", drives=drives, speed=20.0, **joint)
    speeds = np.linspace(5.0, 45.0, 21)
    trend = life_against(machine, "speed", speeds)
    ratio = speeds / 20.0
    amplitude = 2.0 / (40.0 * np.pi) ** 2 / np.hypot(1.0 - ratio**2, 0.1 * ratio)
    free, closed = 2.0 * amplitude < 0.4e-3, amplitude > 0.4e-3
    assert free.any()
    assert closed.any()
    assert np.all(np.isinf(trend.statistical[free]))
    assert np.all(np.isfinite(trend.statistical[closed]))
    assert trend.reference == trend.values[np.isfinite(trend.statistical)][0]
    below, above = trend.longer_lived(20.0, 1e3)
    assert below < 20.0 < above
    assert np.isinf(trend.statistical[np.isin(trend.values, [below, above])]).all()
    with pytest.raises(DesignError, match="no contact from"):
        life_against(machine, "speed", speeds[free][:1])
