"""Small corrections of the speed, once a cycle, hold an orbit that the free motion leaves."""

import gymnasium as gym
import numpy as np

import chaosgym  # noqa: F401  (registers the environments)
from chaosgym.controllers import OGY, ConstantSpeed, DelayedFeedback

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


def test_delayed_feedback_calms_a_weakly_unstable_response():
    """At 20.5 Hz the differences of the peaks alone are enough, and the correction dies out."""
    free, _ = _last_peaks(lambda env: ConstantSpeed(env, 20.5))
    held, speeds = _last_peaks(lambda env: DelayedFeedback(env, 20.5))
    assert free.std() > 1.0
    assert held.std() < 0.1 * free.std()
    assert abs(speeds[-1] - 20.5) < 0.01
