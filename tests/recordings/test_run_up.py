"""Orders and types of run-ups: analytic signals, and a simulated beam whose speed is swept."""

import numpy as np
import pytest

from chaosgym import ImpactBeam, simulate
from chaosgym.errors import DiagnosisError
from chaosgym.recordings.run_up import run_up
from chaosgym.recordings.sampling import Sampling
from chaosgym.recordings.tachometer import turns_of

RATE = 16_000.0
TIME = np.arange(0.0, 40.0, 1.0 / RATE)
INSTANTS = Sampling(TIME, 1.0 / RATE, ())
ANGLES = {"run-up": 8.0 * TIME + 0.3 * TIME**2, "run-down": 32.0 * TIME - 0.3 * TIME**2, "constant": 20.0 * TIME}
ORDERS = {0.5: 0.6, 1.0: 10.0, 2.0: 4.0, 3.2: 0.8, 7.5: 1.0, 19.0: 0.5}


def turns(angle, per_turn=1):
    """Of a square tachometer."""
    return turns_of(5.0 * ((angle * per_turn) % 1.0 < 0.4), TIME, per_turn)


def wave(angle):
    """The orders of ``ORDERS`` on a level of 3."""
    return 3.0 + sum(size * np.cos(2.0 * np.pi * order * angle + order) for order, size in ORDERS.items())


@pytest.mark.parametrize("shape", ANGLES)
@pytest.mark.parametrize("per_turn", [1, 60])
def test_orders_have_their_amplitudes_at_every_speed(shape, per_turn):
    """Six orders, one between lines: each is found, with its amplitude in every frame, to 1 % and 0.2 % of the largest.

    So much is left of pulses that are known to half a sample.
    """
    found = run_up(wave(ANGLES[shape]), INSTANTS, turns(ANGLES[shape], per_turn))
    told = {line.order: line for line in found.lines}
    assert sorted(told) == pytest.approx(sorted(ORDERS), abs=0.005)
    for order, size in ORDERS.items():
        line = told[min(told, key=lambda known: abs(known - order))]
        np.testing.assert_allclose(line.amplitude, size, rtol=0.01, atol=0.02)
    speed = np.gradient(ANGLES[shape], TIME)
    np.testing.assert_allclose(found.spectra.speeds, np.interp(found.spectra.times, TIME, speed), rtol=2e-3)


def test_an_order_is_not_smeared():
    """Three lines and more away nothing is left, below 0.1 % of the largest, as fast as the speed changes."""
    angle = 5.0 * TIME + 0.6 * TIME**2
    shaft = turns_of(np.sin(2.0 * np.pi * angle), TIME)
    found = run_up(10.0 * np.cos(4.0 * np.pi * angle), INSTANTS, shaft).spectra
    away = np.abs(found.orders - 2.0) > 2.5 / 12.0
    assert found.amplitude[:, away].max() < 1e-2
    assert found.amplitude[:, ~away].max() == pytest.approx(10.0, rel=1e-3)


def test_a_resonance_is_seen_where_the_order_meets_it():
    """Order 3 through a resonance at 60 Hz: largest at 1200 rpm, and the curve of the oscillator within 2 %."""
    angle = ANGLES["run-up"]
    ratio = 3.0 * np.gradient(angle, TIME) / 60.0
    size = 2.0 / np.sqrt((1.0 - ratio**2) ** 2 + (0.1 * ratio) ** 2)
    (line,) = run_up(size * np.cos(6.0 * np.pi * angle), INSTANTS, turns(angle)).lines
    assert 60.0 * line.speed == pytest.approx(1200.0, rel=0.02)
    found = run_up(size * np.cos(6.0 * np.pi * angle), INSTANTS, turns(angle)).spectra
    np.testing.assert_allclose(line.amplitude, np.interp(found.times, TIME, size), rtol=0.02)


def test_missing_samples_take_nothing_from_an_order():
    """A hole of a quarter of a turn in every tenth turn leaves the amplitude within 3 %."""
    angle = ANGLES["run-up"]
    value = np.where(angle % 10.0 < 0.25, np.nan, 10.0 * np.cos(2.0 * np.pi * angle))
    line = run_up(value, INSTANTS, turns(angle)).lines[0]
    assert line.order == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(line.amplitude, 10.0, rtol=0.03)


def test_impacts_are_counted_by_the_envelope():
    """Ringing at 2 kHz, excited 3.25 times a turn under a loud first order: the envelope has order 3.25, not 1."""
    angle = ANGLES["run-up"]
    hits = TIME[np.flatnonzero(np.diff(np.floor(3.25 * angle)) > 0)]
    since = TIME - hits[np.maximum(np.searchsorted(hits, TIME, side="right") - 1, 0)]
    rings = np.where(since >= 0.0, np.exp(-400.0 * since) * np.sin(4000.0 * np.pi * since), 0.0)
    found = run_up(10.0 * np.cos(2.0 * np.pi * angle) + rings, INSTANTS, turns(angle))
    assert found.lines[0].order == pytest.approx(1.0, abs=1e-3)
    assert found.envelope[0].order == pytest.approx(3.25, abs=0.01)


def test_noise_has_no_orders():
    """White noise about a mean, and under an order of its size: no order but that one, and no ringing is named."""
    angle = ANGLES["run-up"]
    for seed, loud in ((0, 0.0), (1, 1.0), (2, 1.0)):
        noise = np.random.default_rng(seed).normal(size=len(TIME))
        found = run_up(5.0 + loud * np.cos(2.0 * np.pi * angle) + noise, INSTANTS, turns(angle))
        assert [round(line.order, 2) for line in found.lines] == [1.0][: int(loud)]
        assert found.envelope == ()


def test_a_pure_order_has_no_ringing():
    """What the digits of a file and the ends of the filter leave of a sine has no orders of its own."""
    angle = ANGLES["run-up"]
    found = run_up(np.round(20.0 + 10.0 * np.sin(4.0 * np.pi * angle), 5), INSTANTS, turns(angle))
    assert [round(line.order, 2) for line in found.lines] == [2.0]
    assert found.envelope == ()
    assert "no envelope: nothing rings above the highest order" in found.notes


@pytest.mark.parametrize("way", ["up", "down"])
def test_types_of_peaks_that_rise_and_scatter_above_a_speed(way):
    """Peaks follow the speed, and alternate by 8 N above 1000 rpm, and scatter above 1400: Types I and III as made."""
    angle = ANGLES[f"run-{'up' if way == 'up' else 'down'}"]
    turn, rng = np.floor(angle).astype(int), np.random.default_rng(4)
    rpm = 60.0 * np.gradient(angle, TIME)
    level = 20.0 + 0.02 * rpm + np.where(rpm > 1000.0, 4.0 * (-1.0) ** turn, 0.0)
    level += np.where(rpm > 1400.0, rng.uniform(-9.0, 9.0, turn.max() + 1)[turn], 0.0)
    force = level * np.exp(-60.0 * (1.0 - np.cos(2.0 * np.pi * (angle - 0.4))))
    found = run_up(force, INSTANTS, turns(angle), sensor_error=1.0)
    calm, wild = (region for region in found.types.regions)
    assert (calm.type, wild.type) == ("I", "III")
    assert 1300.0 < calm.last < wild.first < 1460.0


def test_both_directions_are_told_apart():
    """Up to 1200 rpm and down again: types are those of one direction, and that is said; orders are of both."""
    angle = 4.0 * TIME + 16.0 * (TIME / 2.0 - 40.0 / (4.0 * np.pi) * np.sin(2.0 * np.pi * TIME / 40.0))
    found = run_up(np.cos(2.0 * np.pi * angle), INSTANTS, turns(angle), sensor_error=0.1)
    assert any("longest run in one direction" in note for note in found.notes)
    np.testing.assert_allclose(found.lines[0].amplitude, 1.0, rtol=0.01)
    assert found.types is not None


@pytest.mark.parametrize(
    ("angle", "stated", "note"),
    [
        ("constant", {"sensor_error": 0.1}, "not told: it changes by less than 5 %"),
        ("run-up", {}, "not told without the sensor's error"),
    ],
)
def test_types_that_are_not_told_say_why(angle, stated, note):
    """A constant speed and an unknown error."""
    found = run_up(wave(ANGLES[angle]), INSTANTS, turns(ANGLES[angle]), **stated)
    assert found.types is None
    assert any(note in one for one in found.notes)


def test_peaks_that_change_too_fast_for_a_band_are_left_out():
    """A sharp resonance within one band of 24 turns is no irregular motion, and the note says to run up more slowly."""
    angle = ANGLES["run-up"]
    rpm = 60.0 * np.gradient(angle, TIME)
    force = (20.0 + 40.0 / (1.0 + ((rpm - 1200.0) / 12.0) ** 2)) * np.cos(2.0 * np.pi * angle)
    found = run_up(force, INSTANTS, turns(angle), sensor_error=0.5)
    assert any("run up more slowly" in note for note in found.notes)
    assert {one.nature for one in found.types.speeds} == {"periodic"}


def test_a_machine_that_never_touches_has_no_orders():
    """No force at all: no order, no ringing, and Type I throughout."""
    found = run_up(np.zeros_like(TIME), INSTANTS, turns(ANGLES["run-up"]), sensor_error=0.1)
    assert (found.lines, found.envelope) == ((), ())
    assert [region.type for region in found.types.regions] == ["I"]


@pytest.mark.parametrize(
    ("highest", "why"),
    [(300.0, r"order 300 at 192. rpm needs .* samples a second, and there are 1.6e\+04; allowed: up to order 195")],
)
def test_orders_above_the_sampling_are_refused(highest, why):
    """In one line, with the order that can be had."""
    with pytest.raises(DiagnosisError, match=why):
        run_up(wave(ANGLES["run-up"]), INSTANTS, turns(ANGLES["run-up"]), highest=highest)


@pytest.fixture(scope="module")
def swept_beam():
    """The beam from 14 to 26 Hz in 700 cycles: instants, force on the upper surface, and angle."""
    hz = np.linspace(14.0, 26.0, 700)
    beam = ImpactBeam(excitation_frequency=14.0, clearance=1.27e-4)
    run = simulate(beam, 700, transient=100, samples_per_cycle=2000, operation={"excitation_frequency": hz})

    def recorded(rate):
        time = np.arange(0.0, run.time[-1], 1.0 / rate)
        angle = np.interp(time, np.concatenate([[0.0], np.cumsum(1.0 / hz)]), np.arange(701.0))
        shaft = turns_of(5.0 * ((angle * 12.0) % 1.0 < 0.4), time, 12)
        return np.interp(time, run.time, run.surface_force[..., 0].ravel()), Sampling(time, 1.0 / rate, ()), shaft

    return recorded


def test_a_swept_beam_is_irregular_from_where_it_is_at_held_speeds(swept_beam):
    """Type I up to 1000 rpm, where held speeds are periodic; III from 17 Hz to the end, where they are chaotic."""
    found = run_up(*swept_beam(40_000.0), sensor_error=1.0)
    calm, wild = found.types.regions
    assert (calm.type, wild.type) == ("I", "III")
    assert 16.0 * 60.0 < calm.last < 17.1 * 60.0 < wild.first + 60.0
    assert wild.last > 25.5 * 60.0
    assert found.lines[0].order == pytest.approx(1.0, abs=1e-3)


def test_impacts_that_are_sampled_too_slowly_have_no_types(swept_beam):
    """At 8 kHz the peaks of an impact are missed by 2 N of 50, and that would be called irregular."""
    found = run_up(*swept_beam(8_000.0), sensor_error=1.0)
    assert found.types is None
    assert any("peaks last hardly two samples" in note for note in found.notes)


SWEPT = 5.0 * TIME + 35.0 / 80.0 * TIME**2
"""Angle of a run-up from 5 to 40 turns a second."""


def resonance(frequency, damping):
    """Noise through an oscillator, of standard deviation 1."""
    from scipy.signal import lfilter

    turn, decay = 2.0 * np.pi * frequency / RATE, np.exp(-2.0 * np.pi * frequency * damping / RATE)
    noise = np.random.default_rng(0).normal(size=len(TIME))
    found = lfilter([1.0], [1.0, -2.0 * decay * np.cos(turn), decay**2], noise)
    return found / found.std()


def test_a_hum_is_a_fixed_frequency_and_no_order():
    """50 Hz beside the first order: one order, and a line of 50 Hz with its amplitude at all speeds."""
    value = 3.0 * np.cos(2.0 * np.pi * SWEPT) + np.sin(2.0 * np.pi * 50.0 * TIME)
    found = run_up(value + 0.1 * np.random.default_rng(1).normal(size=len(TIME)), INSTANTS, turns(SWEPT))
    assert [round(line.order, 2) for line in found.lines] == [1.0]
    (hum,) = found.fixed
    assert hum.frequency == pytest.approx(50.0, abs=0.2)
    assert hum.amplitude == pytest.approx(1.0, rel=0.1)
    assert hum.damping is None


@pytest.mark.parametrize(("frequency", "damping"), [(60.0, 0.02), (150.0, 0.05), (300.0, 0.01)])
def test_the_fixed_frequency_of_a_resonance_has_its_damping_and_no_orders(frequency, damping):
    """The half-power width of a resonance is twice its damping times its frequency; orders beside it stay."""
    alone = run_up(resonance(frequency, damping), INSTANTS, turns(SWEPT))
    beside = run_up(resonance(frequency, damping) + 3.0 * np.cos(4.0 * np.pi * SWEPT), INSTANTS, turns(SWEPT))
    assert alone.lines == ()
    assert [round(line.order, 2) for line in beside.lines] == [2.0]
    for found in (alone, beside):
        (line,) = found.fixed
        assert line.frequency == pytest.approx(frequency, rel=0.01)
        assert line.damping == pytest.approx(damping, rel=0.35)
        assert line.amplitude == pytest.approx(np.sqrt(2.0), rel=0.2)


def test_an_order_through_a_resonance_is_no_fixed_frequency():
    """What the machine itself excites passes the resonance at one speed and is none of the noise."""
    ratio = 3.0 * np.gradient(SWEPT, TIME) / 60.0
    size = 2.0 / np.sqrt((1.0 - ratio**2) ** 2 + (0.1 * ratio) ** 2)
    noise = 0.1 * np.random.default_rng(1).normal(size=len(TIME))
    found = run_up(size * np.cos(6.0 * np.pi * SWEPT) + noise, INSTANTS, turns(SWEPT))
    assert [round(line.order, 2) for line in found.lines] == [3.0]
    assert found.fixed == ()


def test_pulses_missed_and_doubled_at_once_leave_speed_and_orders():
    """5 % missed and 3 % doubled: the speed stays within 1 % of 5 to 40 turns a second, and no order is added."""
    rng = np.random.default_rng(1)
    pulses = np.interp(np.arange(int(SWEPT[-1]) + 1), SWEPT, TIME)
    pulses = pulses[rng.random(len(pulses)) >= 0.05]
    extra = pulses[rng.random(len(pulses)) < 0.03]
    extra = extra + rng.uniform(0.1, 0.6, len(extra)) / np.interp(extra, TIME, np.gradient(SWEPT, TIME))
    signal = np.zeros(len(TIME))
    for instant in (*pulses, *extra):
        signal[int(instant * RATE) + 1 :][:40] = 5.0
    value = 3.0 * np.cos(2.0 * np.pi * SWEPT) + 1.5 * np.cos(3.0 * np.pi * SWEPT)
    found = run_up(value + 0.3 * np.random.default_rng(2).normal(size=len(TIME)), INSTANTS, turns_of(signal, TIME))
    assert [round(line.order, 2) for line in found.lines] == [1.0, 1.5]
    assert found.speeds.max() == pytest.approx(2400.0, rel=0.01)
    assert found.speeds.min() > 300.0
