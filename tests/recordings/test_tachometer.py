"""Angle and speed from a tachometer, whatever is missing or comes twice."""

import numpy as np
import pytest

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.tachometer import turns_of

RATE = 20_000.0
TIME = np.arange(0.0, 20.0, 1.0 / RATE)
SPEEDS = {
    "run-up": (5.0 * TIME + 0.5 * TIME**2, lambda time: 5.0 + time),
    "run-down": (25.0 * TIME - 0.5 * TIME**2, lambda time: 25.0 - time),
    "constant": (15.0 * TIME, lambda time: np.full_like(time, 15.0)),
    "start from rest": (0.5 * TIME**2, lambda time: time),
    "ripple": (
        15.0 * TIME - 5.0 * (np.cos(0.6 * TIME) - 1.0),
        lambda time: 15.0 + 3.0 * np.sin(0.6 * time),
    ),
}


def pulses(angle, per_turn, width=0.3):
    """A square signal of 5 V."""
    return 5.0 * ((angle * per_turn) % 1.0 < width)


@pytest.mark.parametrize("shape", SPEEDS)
@pytest.mark.parametrize("per_turn", [1, 7, 60])
def test_speed_and_angle_are_those_of_the_shaft(shape, per_turn):
    """Within half a sample of a turn's 800 and more, and 0.5 % of the speed over a turn, by 1, 7 or 60 pulses."""
    angle, speed = SPEEDS[shape]
    found = turns_of(pulses(angle, per_turn), TIME, per_turn)
    inside = TIME[(found.starts[2] < TIME) & (found.starts[-3] > TIME)]
    offset = found.angle(inside) - np.interp(inside, TIME, angle)
    assert np.ptp(offset) < 4e-3
    turn = np.diff(found.starts)
    middles = found.starts[:-1] + 0.5 * turn
    np.testing.assert_allclose(1.0 / turn[2:-2], speed(middles)[2:-2], rtol=5e-3)
    assert (found.missed, found.doubled) == (0, 0)


@pytest.mark.parametrize("shape", SPEEDS)
@pytest.mark.parametrize("per_turn", [1, 60])
def test_missed_and_doubled_pulses_are_mended_and_counted(shape, per_turn):
    """Each fifteenth pulse is missed or doubled, close by or half-way: the angle stays that of the shaft."""
    angle, _ = SPEEDS[shape]
    signal, rng = pulses(angle, per_turn), np.random.default_rng(1)
    numbers = np.floor(angle * per_turn)
    chosen = np.arange(4 * per_turn + 15, numbers[-1] - 15, 15)
    chosen += rng.integers(-3, 4, size=len(chosen))
    missed, close, half = chosen[::3], chosen[1::3], chosen[2::3]
    phase = (angle * per_turn) % 1.0
    signal = np.where(np.isin(numbers, missed), 0.0, signal)
    signal = np.where(np.isin(numbers, close) & (phase > 0.12) & (phase < 0.22), 0.0, signal)
    signal = np.where(np.isin(numbers, half) & (phase > 0.5) & (phase < 0.7), 5.0, signal)
    found, whole = turns_of(signal, TIME, per_turn), turns_of(pulses(angle, per_turn), TIME, per_turn)
    assert (found.missed, found.doubled) == (len(missed), len(close) + len(half))
    inside = TIME[(whole.starts[2] < TIME) & (whole.starts[-3] > TIME)]
    assert np.ptp(found.angle(inside) - whole.angle(inside)) < 0.02


def test_a_wheel_without_two_teeth_tells_the_angle():
    """60 teeth less two, as on engines: 58 pulses a turn, and the gap counts as two that are missed."""
    angle, speed = SPEEDS["run-up"]
    tooth = np.floor(angle * 60.0) % 60.0
    found = turns_of(np.where(tooth < 58.0, pulses(angle, 60), 0.0), TIME, 60)
    turn = np.diff(found.starts)
    assert found.missed == pytest.approx(2.0 * angle[-1], abs=3.0)
    np.testing.assert_allclose(1.0 / turn[2:-2], speed(found.starts[:-1] + 0.5 * turn)[2:-2], rtol=5e-3)


def test_noise_on_the_pulses_and_missing_samples_make_none():
    """A sine with 5 % of noise rises once a turn, and samples that are not there are bridged."""
    angle, _ = SPEEDS["run-up"]
    signal = np.sin(2.0 * np.pi * angle) + 0.05 * np.random.default_rng(2).normal(size=len(TIME))
    signal[50_000:50_200] = np.nan
    found = turns_of(signal, TIME)
    assert (found.missed, found.doubled) == (0, 0)
    assert len(found.starts) == pytest.approx(angle[-1], abs=1.5)


STEADY = SPEEDS["constant"][0]

BACK = 0.9 * (TIME - 0.5 * TIME[-1]) ** 2
"""A coast-down through zero: the shaft goes on backwards, and a tachometer can't tell."""


@pytest.mark.parametrize(
    ("signal", "per_turn", "why"),
    [
        (np.zeros_like(TIME), 1, "rises 0 times, 0 turns; needed: 12 turns or more"),
        (np.full_like(TIME, np.nan), 1, "rises 0 times"),
        (pulses(STEADY / 40.0, 1), 1, "turns; needed: 12"),
        (pulses(STEADY, 1), 60, "4.9. turns, 60 pulses each; needed: 12"),
        (pulses(STEADY, 600), 600, "pulses come every 2.0 samples where the shaft is fastest, and last 1.0"),
        (
            np.where((TIME > 5.0) & (TIME < 6.0), 0.0, pulses(STEADY, 1)),
            1,
            "silent from 5 to 6 s; cut|silent from 4.9.* to 5.9.* s; cut",
        ),
        (np.random.default_rng(3).normal(size=len(TIME)), 1, "is the column that of a tachometer|come every"),
        (pulses(STEADY, 1, 0.05) + pulses(STEADY - 0.1, 1, 0.05), 1, "are doubled"),
        (pulses(BACK, 1), 1, "silent from 9.* s; cut the recording there, as the shaft may have stopped"),
        (pulses(BACK, 60), 60, "silent from 9.* s; cut the recording there, as the shaft may have stopped"),
        (pulses(STEADY, 1), 0, "0 pulses per revolution; allowed: 1 or more"),
    ],
)
def test_what_tells_no_turns_is_refused(signal, per_turn, why):
    """In one line that says what to do."""
    with pytest.raises(DiagnosisError, match=why):
        turns_of(signal, TIME, per_turn)
