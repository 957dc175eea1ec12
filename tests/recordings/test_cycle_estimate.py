"""The cycle of a series without a stated speed: lines of its spectrum, and the envelope where impacts ring."""

import numpy as np
import pytest
from scipy.signal import lfilter

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.cycle_estimate import LONG, estimated_cycle

RATE = 20_000.0


def ringing(speed, natural, damping, *, seconds=8.0, noise=0.01, alternates=False, chaotic=False, rate=RATE):
    """Impacts, ``speed`` a second or two with alternating signs, each with a ring-down, on a sensor with noise."""
    size = int(rate * seconds)
    decay = 2.0 * np.pi * damping * natural
    time = np.arange(int(min(4.0 / decay, seconds) * rate)) / rate
    ring = np.exp(-decay * time) * np.sin(2.0 * np.pi * natural * time)
    signal = np.zeros(size + len(ring))
    impacts = speed * (2 if alternates else 1)
    state = 0.3
    for number, start in enumerate(np.round((np.arange(int(seconds * impacts)) + 0.3) / impacts * rate).astype(int)):
        state = 3.9 * state * (1.0 - state)
        size_of = (0.3 + state if chaotic else 1.0) * (-1 if alternates and number % 2 else 1)
        signal[start : start + len(ring)] += size_of * ring
    return signal[:size] + noise * np.random.default_rng(0).normal(size=size)


@pytest.mark.parametrize("chaotic", [False, True])
@pytest.mark.parametrize("alternates", [False, True])
@pytest.mark.parametrize(
    ("speed", "natural", "damping"), [(25.0, 900.0, 0.03), (7.3, 400.0, 0.01), (41.0, 3100.0, 0.1)]
)
def test_impacts_that_ring_have_the_cycle_of_the_machine(speed, natural, damping, alternates, chaotic):
    """The strongest line of a ring-down lies at its natural frequency; its envelope repeats with the impacts, and
    where their signs alternate the cycle is two of them."""
    signal = ringing(speed, natural, damping, alternates=alternates, chaotic=chaotic)
    cycle, origin = estimated_cycle(signal, 1.0 / RATE)
    assert origin == "the envelope of its ringing"
    assert cycle * speed == pytest.approx(1.0, abs=1e-3)


def test_a_long_recording_of_impacts_is_resolved_by_all_of_it():
    """A cycle that is known to a part in a million stays in phase over a thousand cycles."""
    signal = ringing(25.0, 900.0, 0.03, seconds=60.0)
    assert len(signal) > LONG
    cycle, _ = estimated_cycle(signal, 1.0 / RATE)
    assert cycle * 25.0 == pytest.approx(1.0, abs=2e-6)


TIME = np.arange(160_000) / RATE
TURN = np.sin(2.0 * np.pi * 25.0 * TIME)
PULSE = np.where(25.0 * TIME % 1.0 < 0.05, np.sin(2.0 * np.pi * 250.0 * TIME), 0.0)
OF_ONE_CYCLE = {
    "sinusoid": TURN,
    "modulated load": (1.0 + 0.9 * np.sin(2.0 * np.pi * 2.0 * TIME)) * TURN,
    "pulses of a force": PULSE,
    "pulses that decay over six cycles": PULSE
    * np.array([1.0, 0.8, 0.7, 0.6, 0.5, 0.45])[(25.0 * TIME).astype(int) % 6],
    "an impact every ten turns": TURN + np.where(2.5 * TIME % 1.0 < 0.004, 5.0, 0.0),
}


@pytest.mark.parametrize("signal", OF_ONE_CYCLE.values(), ids=OF_ONE_CYCLE)
def test_the_envelope_of_what_does_not_ring_leaves_the_cycle(signal):
    """Modulation of a load rises as it falls, and pulses of a force lie on one side: neither rings."""
    noise = 0.01 * np.random.default_rng(0).normal(size=len(signal))
    cycle, origin = estimated_cycle(signal + noise, 1.0 / RATE)
    assert origin == "the spectrum"
    assert cycle == pytest.approx(0.04, rel=1e-4)


def test_noise_has_no_cycle():
    """Neither the spectrum of white noise nor its envelope has a line."""
    with pytest.raises(DiagnosisError, match="no line of the spectrum stands out"):
        estimated_cycle(np.random.default_rng(1).normal(size=100_000), 1e-4)


def resonator(value, natural, damping, rate):
    """Answer of a mode to a force, by its difference equation."""
    turn = 2.0 * np.pi * natural / rate
    keeps, swing = np.exp(-damping * turn), turn * np.sqrt(1.0 - damping**2)
    return lfilter([keeps * np.sin(swing)], [1.0, -2.0 * keeps * np.cos(swing), keeps**2], value)


def bearing(seed, race, load, line, *, shaft=25.0, rate=48_828.0, seconds=3.0):
    """Acceleration of a bearing with a damaged race, whose rollers slip by 1.2 % from one to the next, beside noise
    through two resonances and lines of the shaft (Randall and Antoni 2011); (signal, rate, impacts a second)."""
    rng = np.random.default_rng([seed, load, int(100 * line)])
    size, often = int(rate * seconds), {"outer": 3.245, "inner": 4.755, "none": 0.0}[race] * shaft
    signal, time = np.zeros(size), np.arange(size) / rate
    if often:
        instants = np.cumsum((1.0 + 0.012 * rng.normal(size=int(1.2 * often * seconds))) / often)
        instants = instants[instants < seconds - 1.0 / rate]
        sizes = 1.0 + 0.25 * rng.normal(size=len(instants))
        if race == "inner":  # the load zone, once a turn
            sizes *= np.clip(0.25 + np.cos(2.0 * np.pi * shaft * instants), 0.0, None)
        np.add.at(signal, (instants * rate).astype(int), sizes)
    low, high = rng.uniform(2000.0, 4500.0), rng.uniform(7000.0, 12_000.0)
    signal = resonator(signal, low, 0.04, rate) + 0.5 * resonator(signal, high, 0.03, rate)
    signal *= load / max(float(signal.std()), 1e-12)
    noise = 0.3 * resonator(rng.normal(size=size), rng.uniform(900.0, 3000.0), 0.08, rate) + 0.3 * rng.normal(size=size)
    noise += 0.2 * resonator(rng.normal(size=size), low, 0.04, rate)
    turns = sum(np.cos(2.0 * np.pi * k * shaft * time + k) / k for k in (1, 2, 3))
    return signal + 0.4 * noise / noise.std() + line * turns, rate, often


@pytest.mark.parametrize("line", [0.005, 0.2])
@pytest.mark.parametrize("race", ["outer", "inner"])
@pytest.mark.parametrize("load", [1, 2])
def test_a_damaged_bearing_has_the_cycle_of_its_rollers_or_of_its_shaft(race, load, line):
    """Impacts slip, so that they have no lines at high frequencies; the envelope of three octaves repeats with them."""
    signal, rate, often = bearing(1, race, load, line)
    cycle, _ = estimated_cycle(signal, 1.0 / rate)
    assert min(abs(cycle * often - 1.0), abs(cycle * 25.0 - 1.0)) < 5e-3


@pytest.mark.parametrize("seed", range(3))
def test_noise_through_a_resonance_has_no_cycle(seed):
    """A resonance is no line, however much it stands out: neither a sound bearing nor noise of three modes has one."""
    rng = np.random.default_rng(seed)
    modes = sum(resonator(rng.normal(size=80_000), rng.uniform(100.0, 6000.0), 0.03, RATE) for _ in range(3))
    for signal, rate in ((modes, RATE), bearing(seed, "none", 0, 0.0)[:2]):
        with pytest.raises(DiagnosisError, match="no line of the spectrum stands out"):
            estimated_cycle(signal, 1.0 / rate)
