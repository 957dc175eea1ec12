"""The trained sense of the motion as an entry of the observation."""

import math

import gymnasium as gym
import numpy as np
import pytest

import chaosgym
from chaosgym.control.controllers import BackOff
from chaosgym.control.rollout import play
from chaosgym.envs.classified import UNKNOWN, RecordsAtSpeed
from chaosgym.envs.sense import STATISTICS, Sense, load_sense, save_sense, shipped_sense
from chaosgym.errors import ModelFileError, ParameterError

BEAM = "chaosgym/ImpactBeam-v1"
STILL = {"action": "speed", "speed_ripple": 0.0, "tolerances": {}, "classifier": "on"}


@pytest.mark.parametrize(("speed", "irregular"), [(12.0, False), (20.0, False), (23.5, True), (24.0, True)])
def test_the_classifier_tells_a_chaotic_beam_from_a_periodic_one(speed, irregular):
    """With a fine sensor the probability is above a half where the motion is chaotic, and below where it repeats."""
    env = gym.make(BEAM, **STILL, sensor_error=0.05)
    env.reset(seed=0, options={"speed": speed})
    for _ in range(12):
        observation, *_, info = env.step(np.array([speed], np.float32))
    seen = dict(zip(env.unwrapped.observation_names, observation, strict=True))
    assert env.observation_space.contains(observation)
    assert (info["type_iii"] > 0.5) == irregular
    assert (seen["irregular_probability"] > 0.5) == irregular


def test_both_entries_stand_in_the_order_of_their_names():
    """Monitor and classifier follow the fourteen in the order of ``observation_names``, and each says what it says
    alone."""
    seen = {}
    for keywords in ({"monitor": "on"}, {"classifier": "on"}, {"monitor": "on", "classifier": "on"}):
        env = gym.make(BEAM, **{**STILL, "classifier": "off", **keywords})
        env.reset(seed=1, options={"speed": 22.0})
        for _ in range(3):
            observation, *_ = env.step(np.array([22.0], np.float32))
        seen[tuple(keywords)] = dict(zip(env.unwrapped.observation_names, observation, strict=True))
    both = seen["monitor", "classifier"]
    assert list(both)[-2:] == ["monitor_level", "irregular_probability"]
    assert both == seen["monitor",] | seen["classifier",]


def of_one(record, lags=(1, 2, 3, 4, 6, 8)):
    """Statistics of the peaks (cycles,) of one record."""
    missed = [np.abs(record[lag:] - record[:-lag]).mean() for lag in lags]
    return [record.mean(), record.std(), record.min(), record.max(), *missed]


def test_a_network_gives_the_logistic_of_its_last_layer():
    """Two rectified units in turn and one answer, by hand: a chance from 0 to 1, a half where nothing is said."""
    entries = len(STATISTICS)
    weights = np.zeros((1, entries)), np.array([[1.0]]), np.array([[2.0]])
    weights[0][0, 0] = 1.0
    biases = np.zeros(1), np.zeros(1), np.array([-1.0])
    sense = Sense(1.0, np.zeros(entries), np.ones(entries), weights, biases)
    statistics = np.zeros((3, entries))
    statistics[:, 0] = [0.5, 3.0, -3.0]
    expected = [0.5, 1.0 / (1.0 + math.exp(-5.0)), 1.0 / (1.0 + math.exp(1.0))]
    np.testing.assert_allclose(sense(statistics), expected, rtol=1e-12)


def test_a_record_is_what_was_felt_since_the_speed_changed():
    """Statistics are of the last 64 peaks at one speed, of the last ten of them, and of the steps' impacts and
    bouncing; the entry is what the shipped sense makes of them, and too few cycles tell nothing."""
    machine, generator, which = chaosgym.ImpactBeam(), np.random.default_rng(0), np.array([0, 2])
    peaks, impacts, bouncing = 20.0 + generator.random((2, 100)), generator.random((20, 2)), generator.random((20, 2))
    records = RecordsAtSpeed(machine, 1.0, 3)
    records.add(which, np.array([12.0, 13.0]), peaks[:, :5], impacts[0], bouncing[0])
    assert (records.irregular_probability(which) == UNKNOWN).all()
    for step in range(1, 20):
        cycles = slice(5 * step, 5 * step + 5)
        records.add(which, np.array([12.0, 13.0]), peaks[:, cycles], impacts[step], bouncing[step])
    expected = [12.0, 64.0, 1.0, *of_one(peaks[0, -64:]), *of_one(peaks[0, -10:])]
    expected += [impacts[:, 0].mean(), bouncing[:, 0].mean(), impacts[-1, 0], bouncing[-1, 0]]
    told = records.statistics(which)
    np.testing.assert_allclose(told[0], expected)
    assert told.shape == (2, len(STATISTICS))
    assert records.irregular_probability(which).tolist() == shipped_sense(machine.name)(told).tolist()
    records.add(which, np.array([12.0, 14.0]), peaks[:, :10], impacts[0], bouncing[0])
    np.testing.assert_allclose(records.statistics(which)[1, 3:23], 2 * of_one(peaks[1, :10]))
    assert records.irregular_probability(np.array([1])) == UNKNOWN


def test_a_sense_that_does_not_fit_is_refused(tmp_path):
    """A file of another number of statistics, or one whose bytes were changed, is refused in one line."""
    sense, path = shipped_sense("impact-beam"), tmp_path / "sense.npz"
    save_sense(sense, {}, path)
    statistics = np.random.default_rng(0).uniform(1.0, 50.0, (4, len(STATISTICS)))
    np.testing.assert_array_equal(load_sense(path)(statistics), sense(statistics))
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(ModelFileError):
        load_sense(path)
    save_sense(sense._replace(mean=sense.mean[1:]), {}, path)
    with pytest.raises(ModelFileError, match=r"can't be read as a sense|does not tell"):
        load_sense(path)
    with pytest.raises(ModelFileError, match="no sense is shipped for any-machine"):
        shipped_sense("any-machine")


def test_backing_off_by_the_classifier_leaves_chaos():
    """On beams of the fleet's training, backing off by the trained sense spends fewer irregular cycles."""
    fleet = {"level": "fleet", "split": "train", "steps": 60}
    shares = [
        play(controller, "chaosgym/ImpactBeamTolerance-v1", range(12), **fleet).type_iii_share.mean()
        for controller in (chaosgym.control.controllers.Follow(), BackOff(classified=True))
    ]
    assert shares[1] < shares[0]


def test_a_machine_without_a_classifier_of_records_says_so():
    """The keyword is refused where no classifier is shipped, with what is allowed in its place."""
    with pytest.raises(ParameterError, match="for modal-machine it ships none; allowed: 'off', or monitor"):
        gym.make("chaosgym/AnyMachine-v0", classifier="on")
