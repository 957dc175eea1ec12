"""Skip bands hold the reference at an edge, cross at the full rate, and do not chatter."""

import gymnasium as gym
import numpy as np
import pytest

import chaosgym  # noqa: F401  (registers the environments)
from chaosgym.control.controllers import Controller, SkipBands
from chaosgym.control.controllers.skip_bands import skipped_bands

SPEEDS = np.arange(4.0, 30.01, 0.25)


class Demands(Controller):
    """A demand that follows a list of speeds."""

    def __init__(self, env, speeds):
        super().__init__(env)
        self.speeds = iter(speeds)

    def __call__(self, observation):
        """Return the next one."""
        return self.command(next(self.speeds))


@pytest.fixture
def bands():
    """Bands of 10 to 14 Hz, and of 28 Hz to the end of the table."""
    flags = ((SPEEDS > 10.0) & (SPEEDS < 14.0)) | (SPEEDS > 28.0)
    return skipped_bands(SPEEDS, flags, 0.0)


def _references(demands, bands, hysteresis):
    env = gym.make("chaosgym/ImpactBeam-v0")
    controller = SkipBands(env, Demands(env, demands), hysteresis=hysteresis)
    env.reset(seed=0)
    controller.reset()
    controller.bands = bands
    return [float(env.unwrapped.drive.target_of(controller(None))[1]) for _ in demands]


def test_bands_lie_between_the_calm_speeds_of_the_table(bands):
    """Edges are speeds that may be held; the last band reaches beyond the table; margins merge close bands."""
    assert bands == [(10.0, 14.0), (28.0, 30.25)]
    assert skipped_bands(SPEEDS, np.isin(SPEEDS, [10.0, 11.0]), 0.5) == [(9.25, 11.75)]


def test_a_demand_in_a_band_waits_at_the_edge_it_came_from(bands):
    """Within half a band of hysteresis the reference is frozen until the demand has left the band."""
    references = _references([9.0, 11.0, 13.5, 14.5, 13.5, 10.5, 9.5], bands, 0.5)
    assert np.allclose(references, [9.0, 10.0, 10.0, 14.5, 14.0, 14.0, 9.5], atol=1e-5)


def test_with_less_hysteresis_the_reference_changes_sides_within_the_band(bands):
    """A quarter of 4 Hz past the middle, 13 Hz upwards and 11 Hz downwards, decides."""
    references = _references([9.0, 12.9, 13.1, 11.1, 10.9], bands, 0.25)
    assert np.allclose(references, [9.0, 10.0, 14.0, 14.0, 10.0], atol=1e-5)


def test_a_demand_that_wavers_about_the_middle_does_not_chatter(bands):
    """Without hysteresis the reference jumps with every sign; with it, it stays."""
    wavering = [9.0, *([11.9, 12.1] * 5)]
    assert len(set(np.round(_references(wavering, bands, 0.0)[1:], 3))) == 2
    assert len(set(np.round(_references(wavering, bands, 0.25)[1:], 3))) == 1


def test_a_band_at_the_end_of_the_range_is_never_entered(bands):
    """There is no other side to go to."""
    assert np.allclose(_references([27.0, 29.0, 30.0], bands, 0.25), [27.0, 28.0, 28.0], atol=1e-5)


def test_the_ramp_crosses_a_band_at_the_slew_limit():
    """With the real nominal bands, the machine is in no band for more steps than its width over the slew limit."""
    env = gym.make("chaosgym/ImpactBeam-v0")
    controller = SkipBands(env)
    observation, _ = env.reset(seed=0)
    controller.reset()
    speeds, ended = [], False
    while not ended:
        observation, _, terminated, truncated, info = env.step(controller(observation))
        speeds.append(info["speed"])
        ended = terminated or truncated
    assert controller.bands
    for low, high in controller.bands:
        inside = sum(low + 1e-6 < speed < high - 1e-6 for speed in speeds)
        assert inside <= np.ceil(high - low)
