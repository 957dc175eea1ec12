"""Areas under the curve of what judges records."""

import json

import numpy as np
import pytest

from benchmarks.envs.sense import Held, area, held, lines, looks, measured, observation, observed, sense, statistics
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.memory import irregularity
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ParameterError

ENV = "chaosgym/ImpactBeamTolerance-v1"


def made_up(machines=40, seed=0):
    """Half of the records repeat, the others scatter by 20 N."""
    generator = np.random.default_rng(seed)
    wild = generator.random((machines, 4)) < 0.5
    peaks = 80.0 + 20.0 * wild[:, :, None, None] * generator.standard_normal((machines, 4, 60, 2))
    share = np.repeat(wild[:, :, None].astype(float), 6, axis=2)
    impacts, bouncing = np.full((machines, 4, 60), 2), np.full((machines, 4, 60), 0.2)
    return Held(peaks, impacts, bouncing, share, np.full((machines, 4), 18.0))


def test_an_observation_is_that_of_the_environment():
    """Peaks of a step make the mean, deviation, maximum and repeats that the environment reports, without errors."""
    ideal = {"sensor_error": 0.0, "missed_impacts": 0.0, "bouncing_error": 0.0, "speed_ripple": 0.0}
    envs = native_envs(ENV, 1, **ideal)
    envs.reset(seed=0)
    cycles = []
    moved = envs.jobs.batch.run_varied

    def kept(which, speeds):
        """What the machine did."""
        cycles.append(moved(which, speeds))
        return cycles[-1]

    envs.jobs.batch.run_varied = kept
    seen, *_ = envs.step(np.zeros(1, int))
    places = [PLACE.mean_peak_force, PLACE.std_peak_force, PLACE.max_peak_force]
    places += [PLACE.repeat_1, PLACE.repeat_2, PLACE.repeat_4]
    np.testing.assert_allclose(
        observed(cycles[0][0].peak_force[:, :, 0])[:, places], seen[:, places], rtol=1e-4, atol=1e-4
    )


def test_machines_hold_speeds_of_the_task():
    """Each speed is on the grid and within the slew limit of the one before; labels are shares."""
    record = held(3, 4, 1)
    assert record.peaks.shape == (3, 4, 60, 2)
    moves = np.abs(np.diff(record.speed, axis=1))
    assert ((moves > 0.0) & (moves <= 2.0)).all()
    assert ((record.share >= 0.0) & (record.share <= 1.0)).all()
    noisy = measured(record, 1.0, 0)
    assert np.abs(noisy.peaks - record.peaks).max() <= 1.0
    assert (noisy.impacts <= record.impacts).all()
    assert measured(record, 0.0, 0) is record


def test_a_sense_that_knows_has_an_area_of_one():
    """Labels themselves have an area of 1, coins one of a half, and the opposite none."""
    labels = made_up().share[:, :, 0].ravel() > 0.5
    assert area(labels, labels.astype(float), 40) == {"auc": 1.0, "low": 1.0, "high": 1.0}
    assert area(labels, -labels.astype(float), 40)["auc"] == 0.0
    coins = area(labels, np.random.default_rng(1).random(len(labels)), 40)
    assert coins["low"] < 0.5 < coins["high"]


def test_rows_are_kept(tmp_path, monkeypatch):
    """Every sense but the records' tells scatter of 20 N from none; a second call simulates nothing."""
    monkeypatch.setattr(
        "benchmarks.envs.sense.held", lambda machines, speeds, seed, split="train", env=ENV: made_up(machines, seed)
    )
    monkeypatch.setattr("benchmarks.envs.sense.looks", lambda step: (step, 60))
    monkeypatch.setattr("benchmarks.envs.sense.DRAWS", 20)
    kept, senses = tmp_path / "sense.json", ("felt", "felt, all", "observation", "sequence", "shipped")
    found = sense(40, 40, 4, senses, kept)
    assert len(found) == 10
    assert min(row["areas"][looked]["auc"] for row in found for looked in ("10", "60")) > 0.99
    monkeypatch.setattr("benchmarks.envs.sense.held", None)
    assert sense(40, 40, 4, senses, kept) == found
    assert len(lines(found)) == 12
    with pytest.raises(ParameterError, match="give these numbers"):
        sense(41, 40, 4, senses, kept)
    assert json.loads(kept.read_text())["of"]["machines"] == 40


def test_cranks_hold_speeds_in_steps_of_their_own():
    """Twenty cycles make a step; kicks, and no ripple, keep a calm crank from repeating exactly."""
    record = held(3, 1, 1, env="chaosgym/SliderCrankTolerance-v1")
    assert record.share.shape == (3, 1, 3)
    assert record.step == 20
    assert looks(record.step) == (20, 40, 60)
    assert looks(10) == (10, 30, 60)
    assert ((record.bouncing >= 0.0) & (record.bouncing <= 1.0)).all()
    assert (np.ptp(record.peaks[:, :, -20:, 0], axis=2) > 0.0).all()


def test_a_longer_look_is_another_number():
    """Statistics of 10 and of 60 cycles differ; the observation is of the last ten alone, and has the speed."""
    record = made_up(4)
    assert (statistics(record, 10) != statistics(record, 60)).any()
    last = observation(record, 60)
    np.testing.assert_allclose(last[:, PLACE.speed], 18.0)
    calm = record.share[:, :, 0].ravel() == 0.0
    np.testing.assert_allclose(irregularity(last[calm]), 0.0, atol=1e-9)
