"""Small corrections of the speed, once a cycle, hold an orbit that the free motion leaves."""

import gymnasium as gym
import numpy as np

import chaosgym  # noqa: F401  (registers the environments)
from chaosgym.control.controllers import OGY, ConstantSpeed, DelayedFeedback
from chaosgym.diagnosis.periodic_orbit import find_periodic_orbit
from chaosgym.simulation.batch import at_speed

EACH_CYCLE = {"cycles_per_step": 1, "slew_limit": 0.2, "sensor_error": 0.0, "job_cycles": 500}


def _last_peaks(make, **keywords):
    """Peak forces [N] of the last 50 cycles of a job of the nominal beam, and speeds [Hz] of its steps."""
    env = gym.make("chaosgym/ImpactBeam-v0", **{**EACH_CYCLE, **keywords})
    observation, _ = env.reset(seed=0, options={"speed": 18.0})
    controller = make(env)
    controller.reset()
    peaks, speeds, ended = [], [], False
    while not ended:
        observation, _, terminated, truncated, info = env.step(controller(observation))
        peaks.append(observation[-1])
        speeds.append(info["speed"])
        ended = terminated or truncated
    return np.array(peaks[-50:]), np.array(speeds[-50:])


def test_ogy_holds_an_orbit_of_the_chaotic_beam():
    """At 29.5 Hz the free peak forces scatter by newtons; held, they are one force, and no correction is left over."""
    free, _ = _last_peaks(lambda env: ConstantSpeed(env, 29.5))
    held, speeds = _last_peaks(lambda env: OGY(env, 29.5))
    assert free.std() > 1.0
    assert held.std() < 0.01 * held.mean()
    assert np.ptp(speeds) < 0.02
    assert abs(speeds[-1] - 29.5) < 0.11


def test_delayed_feedback_does_not_reach_the_orbit_that_ogy_holds():
    """At 29.5 Hz its one unstable multiplier is positive, the case that delayed feedback is known not to hold."""
    env = gym.make("chaosgym/ImpactBeam-v0", **EACH_CYCLE)
    env.reset(seed=0)
    controller = OGY(env, 29.5)
    controller.reset()
    orbit = find_periodic_orbit(at_speed(env.unwrapped.machine, controller.hold.speed), controller.hold.state, 1)
    assert orbit.multipliers[0].real > 1.0 > abs(orbit.multipliers[1])
    delayed, _ = _last_peaks(lambda env: DelayedFeedback(env, 29.5))
    assert delayed.std() > 1.0


def test_delayed_feedback_follows_its_law_and_vanishes_on_repeating_peaks():
    """u = K (F_k - F_(k-1) + R ...), clipped to half a slew limit; equal peaks ask for nothing."""
    env = gym.make("chaosgym/ImpactBeam-v0", **EACH_CYCLE)
    observation, _ = env.reset(seed=0)
    controller = DelayedFeedback(env, 20.0, gain=-0.01, memory=0.5)
    controller.reset()
    asked = []
    for force in (40.0, 50.0, 50.0, 1000.0, 40.0):
        observation[-1] = force
        asked.append(float(env.unwrapped.drive.target_of(controller(observation))[1]) - 20.0)
    assert np.allclose(asked, [0.0, -0.02, -0.01, -0.1, 0.1], atol=1e-5)
    controller.reset()
    for _ in range(3):
        assert abs(env.unwrapped.drive.target_of(controller(observation))[1] - 20.0) < 1e-5
