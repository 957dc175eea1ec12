"""The trained classifier of records as an entry of the observation."""

import gymnasium as gym
import numpy as np
import pytest

import chaosgym
from chaosgym.control.controllers import BackOff
from chaosgym.control.rollout import play
from chaosgym.envs.classified import UNKNOWN, RecordsAtSpeed
from chaosgym.errors import ParameterError

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


def test_a_record_is_what_was_felt_since_the_speed_changed():
    """The entry is the shipped classifier's answer on the last 64 peaks at one speed; too few cycles tell nothing."""
    machine, generator, which = chaosgym.ImpactBeam(), np.random.default_rng(0), np.array([0, 2])
    peaks = 20.0 + generator.random((2, 100))
    records = RecordsAtSpeed(machine, 1.0, 3)
    records.add(which, np.array([12.0, 13.0]), peaks[:, :5])
    assert (records.irregular_probability(which) == UNKNOWN).all()
    for first in range(5, 100, 5):
        records.add(which, np.array([12.0, 13.0]), peaks[:, first : first + 5])
    classifier = chaosgym.default_classifier(machine.name)
    answers = classifier.classify_records(peaks, sensor_error=1.0)["irregular_probability"]
    assert records.irregular_probability(which).tolist() == list(answers)
    records.add(which, np.array([12.0, 14.0]), peaks[:, :10])
    fresh = classifier.classify_records(peaks[1:, :10], sensor_error=1.0)["irregular_probability"]
    assert records.irregular_probability(which)[1] == fresh[0]
    assert records.irregular_probability(np.array([1])) == UNKNOWN


def test_backing_off_by_the_classifier_leaves_chaos():
    """On the nominal beam at a demand in chaos, backing off by the classifier spends fewer irregular cycles."""
    shares = [
        play(controller, BEAM, [3, 4], steps=40, tolerances={}).type_iii_share.mean()
        for controller in (chaosgym.control.controllers.Follow(), BackOff(classified=True))
    ]
    assert shares[1] < shares[0]


def test_a_machine_without_a_classifier_of_records_says_so():
    """The keyword is refused where no classifier is shipped, with what is allowed in its place."""
    with pytest.raises(ParameterError, match="for modal-machine it ships none; allowed: 'off', or monitor"):
        gym.make("chaosgym/AnyMachine-v0", classifier="on")
