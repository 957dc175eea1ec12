"""What the thesis saw, on the library's crank: printed forces and natures of responses, hits and documented misses."""

from dataclasses import replace

import numpy as np
import pytest

from chaosgym.simulation import simulate
from tests.plain_modes import PLAIN_CRANK
from thesis.figures.crank_resonances import SUPERHARMONIC_SLIDER_CRANK

CRANK = PLAIN_CRANK


def peaks(machine, cycles=50, transient=60, **changes):
    """Largest resultant of each revolution [N]."""
    return simulate(replace(machine, **changes), cycles, transient=transient).peak_force.max(axis=1)


def spread(machine, **changes):
    """Largest minus smallest peak of 50 revolutions [N]."""
    return float(np.ptp(peaks(machine, **changes)))


@pytest.mark.parametrize("speed", [150.0, 180.0, 200.0, 230.0, 250.0, 270.0, 280.0, 290.0, 300.0])
def test_small_clearance_is_periodic_at_5_percent(speed):
    """At +-0.032 mm, 5 % contact damping, 50 peaks recur within 0.5 % (periodic in figure 4.14a and 5.2.2)."""
    force = peaks(CRANK, crank_speed=speed, slider_clearance=0.032e-3)
    assert np.ptp(force) < 0.005 * force.mean()


def test_large_clearance_is_irregular():
    """At +-0.254 mm and 190 rpm peaks scatter around 91 N between about 80 and 105 N (printed: 85 to 110 N)."""
    force = peaks(CRANK, cycles=200)
    assert force.mean() == pytest.approx(91.0, abs=4.0)
    assert np.ptp(force) > 15.0
    assert 75.0 < force.min() < force.max() < 112.0


def test_contact_damping_removes_chaos():
    """At +-0.032 mm, 2.5 % contact damping scatters the peaks; 5 % leaves a tenth of that scatter or less (4.5.4)."""
    speeds = (170.0, 190.0, 230.0, 260.0, 290.0)
    low, high = (
        np.mean([spread(CRANK, crank_speed=s, slider_clearance=0.032e-3, contact_damping_ratio=z) for s in speeds])
        for z in (0.025, 0.05)
    )
    assert low > 1.0
    assert high < low / 10


def test_forces_at_small_clearance_are_those_of_the_thesis():
    """35, 48, 40 N at 270, 280, 290 rpm are printed; the model rises smoothly through 40 N and misses the crest."""
    force = [peaks(CRANK, crank_speed=s, slider_clearance=0.032e-3).max() for s in (270.0, 280.0, 290.0)]
    assert force == pytest.approx([35.0, 40.0, 40.0], rel=0.15)
    assert force[1] < 48.0


def test_contact_is_lost_and_resumed_with_an_impact():
    """At 230 rpm, +-0.032 mm the slider flies for 23 deg and strikes with 32 N (printed: 20 deg, about 30 N; 4.4.2).

    Printed from 55 to 75 deg, here from 72 to 96: the zero of the inertia force lies at 78 deg.
    """
    machine = replace(CRANK, crank_speed=230.0, slider_clearance=0.032e-3)
    force = np.abs(simulate(machine, 1, transient=60, samples_per_cycle=3600).history[0, :, 2])
    struck = 850 + int(np.argmax(force[850:1000]))
    flying = np.flatnonzero(force[:struck] == 0.0)
    end = flying[-1]
    start = np.flatnonzero(force[:end])[-1]
    assert start / 10 == pytest.approx(72.5, abs=1.0)
    assert end / 10 == pytest.approx(95.8, abs=1.0)
    assert force[struck] == pytest.approx(32.0, abs=4.0)


def test_gravity_keeps_the_slider_on_the_guide():
    """Its weight holds the slider down below about 360 rpm, so the thesis' impacts need a slider without weight."""
    for speed in (200.0, 300.0):
        record = simulate(replace(CRANK, crank_speed=speed, slider_clearance=0.032e-3, gravity=9.81), 5, transient=60)
        assert record.impacts.sum() == 0
        assert record.contact_fraction.max() == pytest.approx(1.0)
    assert simulate(replace(CRANK, crank_speed=450.0, gravity=9.81), 5, transient=30).impacts.sum() > 0


def test_pitch_makes_impacts_in_spite_of_gravity():
    """A slider whose centre of gravity lies 30 mm off the guide rocks on its two stations of sensors.

    At 230 rpm and +-0.032 mm it strikes with 29 N, as strong as the thesis' impacts, although its weight holds it
    down; centred it stays at rest.
    """
    machine = replace(
        CRANK,
        crank_speed=230.0,
        slider_clearance=0.032e-3,
        slider_joint="instrumented",
        gravity=9.81,
        slider_pitch_inertia=3e-4,
    )
    assert simulate(machine, 5, transient=40).impacts.sum() == 0
    rocking = simulate(replace(machine, slider_offset_across=0.03), 5, transient=40)
    assert rocking.impacts.sum() > 0
    assert rocking.peak_force.max() == pytest.approx(29.0, abs=3.0)


@pytest.mark.parametrize(("clearance", "over_background"), [(0.0, 8.0), (0.127e-3, 3.0)])
def test_the_third_superharmonic_resonance(clearance, over_background):
    """With end bodies off the rod's ends, forces crest at a third of 75.6 Hz, 1508 rpm, whatever the clearance.

    With clearance the background is irregular; its mean counts.
    """
    speeds = np.arange(1484.0, 1533.0, 4.0)
    machine = replace(SUPERHARMONIC_SLIDER_CRANK, matrix_update_interval=2.0, slider_clearance=clearance)
    force = np.array([peaks(machine, crank_speed=float(s)).max() for s in speeds])
    crest = int(np.argmax(force))
    assert abs(speeds[crest] - 1508.0) <= 8.0
    assert 1500.0 < force[crest] < 3500.0
    background = max(peaks(machine, crank_speed=s).mean() for s in (1420.0, 1600.0))
    assert force[crest] > over_background * background


def harmonic(machine, order, **changes):
    """Amplitude [N] of a harmonic of the settled force, averaged over 20 revolutions."""
    record = simulate(replace(machine, **changes), 20, transient=250, samples_per_cycle=128)
    return float(np.abs(np.fft.rfft(record.history[:, :, 2], axis=1)[:, order] / 64.0).mean())


@pytest.mark.parametrize(("order", "speed", "height"), [(3, 1508.0, 1000.0), (4, 1132.0, 4.0), (5, 905.0, 2.5)])
def test_superharmonic_resonances_of_orders_3_to_5(order, speed, height):
    """The n-th harmonic of the force crests at an n-th of 75.6 Hz, tenfold over its size 3 % above and below (4.5.5).

    Zero clearance. Order 3 is the whole force; orders 4 and 5 are there, but with 9 and 5 N they stay under an inertia
    force of 93 and 56 N, so the peak force itself rises by 4 and 3 % only. The thesis shows them in figure 4.18 without
    a number.
    """
    machine = replace(SUPERHARMONIC_SLIDER_CRANK, matrix_update_interval=2.0, slider_clearance=0.0)
    crest, *beside = (harmonic(machine, order, crank_speed=speed * share) for share in (1.0, 0.97, 1.03))
    assert crest > height
    assert crest > 10.0 * max(beside)


def test_geometric_stiffness_lifts_the_fourth_order_into_the_peak_force():
    """With the rod's tension the force at 1130 rpm is at least 1.7 times that 2 % above and below, without it 1.1."""
    ratios = []
    for switch in ("off", "on"):
        machine = replace(
            SUPERHARMONIC_SLIDER_CRANK, matrix_update_interval=2.0, slider_clearance=0.0, geometric_stiffness=switch
        )
        crest, *beside = (
            peaks(machine, cycles=20, transient=250, crank_speed=speed).mean() for speed in (1130.0, 1106.0, 1154.0)
        )
        ratios.append(crest / max(beside))
    assert ratios[0] < 1.1
    assert ratios[1] > 1.7


@pytest.mark.parametrize(
    ("speed", "without", "with_friction"), [(200.0, "periodic", "irregular"), (180.0, "irregular", "periodic")]
)
def test_friction_changes_the_nature_at_single_speeds(speed, without, with_friction):
    """At +-0.032 mm, 2.5 %, a coefficient of 0.1 makes one speed irregular and another periodic (figure 4.17).

    The printed speeds are 230 and 260 rpm; here both scatter by 3 to 6 N with friction and without. Chaos before the
    periodic motion at 200 rpm lasts for up to 200 revolutions, as rounding has it; so do the extremes of 50 peaks.
    """
    for friction, nature in ((0.0, without), (0.1, with_friction)):
        setting = {"slider_clearance": 0.032e-3, "contact_damping_ratio": 0.025, "friction_coefficient": friction}
        force = peaks(CRANK, cycles=200, transient=400, crank_speed=speed, matrix_update_interval=0.5, **setting)
        scatter = float(np.ptp(force))
        assert scatter < 0.1 if nature == "periodic" else scatter > 1.5, (friction, scatter)


def test_matrix_updates_at_5_and_10_degrees_agree_on_a_periodic_response():
    """270 rpm, +-0.032 mm: two runs converge within 6 revolutions to 0.3 % of each other (5.2.2 case one)."""
    runs = [
        peaks(
            CRANK, cycles=35, transient=0, crank_speed=270.0, slider_clearance=0.032e-3, matrix_update_interval=interval
        )
        for interval in (5.0, 10.0)
    ]
    assert np.abs(runs[0] - runs[1])[6:].max() < 0.003 * runs[0].mean()
    assert max(np.ptp(run[6:]) for run in runs) < 1e-3 * runs[0].mean()


def test_matrix_updates_at_5_and_6_degrees_part_on_a_chaotic_response():
    """190 rpm, +-0.254 mm: close in the first turn, then apart as the peaks scatter, the mean the same (case two)."""
    runs = [peaks(CRANK, cycles=100, transient=0, matrix_update_interval=interval) for interval in (5.0, 6.0)]
    apart = np.abs(runs[0] - runs[1])
    assert apart[0] < 0.5
    assert apart[20:].max() > 12.0
    assert runs[0][20:].mean() == pytest.approx(runs[1][20:].mean(), rel=0.03)


BALL = replace(
    CRANK, slider_joint="ideal", ball_joint="spherical", gravity=9.81, rod="rigid", matrix_update_interval=5.0
)


@pytest.mark.parametrize(
    ("speed", "lost"), [(80.0, False), (120.0, True), (140.0, True), (220.0, False), (350.0, False)]
)
def test_the_spherical_ball_joint_loses_contact_between_110_and_190_rpm(speed, lost):
    """At +-0.127 mm the ball leaves its shell only where weight and inertia balance (figures 4.8 and 4.9).

    Between 110 and 190 rpm it does so in some revolutions and not in others, least often at both ends.
    """
    record = simulate(replace(BALL, crank_speed=speed), 12, transient=12)
    assert (record.impacts.sum() > 0) == lost
    assert (record.contact_fraction.sum(axis=1).min() < 0.999) == lost


@pytest.mark.parametrize("speed", [80.0, 130.0, 160.0])
def test_without_gravity_the_spherical_ball_joint_keeps_contact(speed):
    """In a plane perpendicular to gravity there is no contact loss (4.4.1)."""
    record = simulate(replace(BALL, crank_speed=speed, gravity=0.0), 8, transient=12)
    assert record.impacts.sum() == 0
    assert record.contact_fraction.sum(axis=1) == pytest.approx(1.0)


def test_the_instrumented_ball_joint_strikes_a_sensor_twice_a_turn():
    """At +-0.127 mm and 100 rpm impulsive forces begin near 100 and 300 deg; before them the ball rests (figure 4.10).

    Before the second one the ball is in touch with other sensors, as the thesis stresses.
    """
    machine = replace(BALL, ball_joint="instrumented", crank_speed=100.0, matrix_update_interval=1.0)
    force = np.abs(simulate(machine, 1, transient=20, samples_per_cycle=3600).history[0, :, 2])
    loud = np.flatnonzero(force > 20.0) / 10.0
    first, second = loud[loud > 60.0][0], loud[loud > 220.0][0]
    assert first == pytest.approx(100.0, abs=15.0)
    assert second == pytest.approx(300.0, abs=15.0)
    assert force[2300:2800].min() > 1.0
