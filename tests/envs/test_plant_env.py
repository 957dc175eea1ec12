"""A plant as an environment: what it tells is what is observed and paid, and nobody knows more of it."""

import gc
import threading

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import chaosgym
from chaosgym.envs.task import Status
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.simulation.fmu import export_fmu
from docs.examples.rig import Rig

RANGE = {"lowest_speed": 10.0, "highest_speed": 24.0, "reference_force": 180.0}
SHORT = {"steps": 12, "shortest_hold": 4, "longest_hold": 6}


class Told:
    """A plant that tells what it is made with, and counts how often it is stopped."""

    def __init__(self, peaks=(80.0, 81.0), fails_at=None, **extras):
        self.peaks, self.extras, self.fails_at = peaks, extras, fails_at
        self.runs = self.stops = 0

    def reset(self):
        """Begin to count."""
        self.runs = 0

    def stop(self):
        """Count."""
        self.stops += 1

    def run(self, speed, cycles):
        """The same peaks again and again."""
        self.runs += 1
        if self.runs == self.fails_at:
            raise OSError("the cable is out")
        return {"peaks": np.resize(self.peaks, cycles), **self.extras}


def made(plant=Rig, **keywords):
    """The environment of a plant."""
    return gym.make("chaosgym/Plant-v0", plant=plant, **(RANGE | SHORT | keywords))


def test_it_is_an_environment():
    """Gymnasium's own check finds nothing; the same seed gives the same job on a plant that has no noise."""
    check_env(made().unwrapped)
    returns = []
    for _ in range(2):
        env = made()
        env.reset(seed=5)
        returns.append(sum(env.step(1)[1] for _ in range(12)))
    assert returns[0] == returns[1] < 0.0


def test_our_own_fmu_is_paid_as_the_machine(tmp_path):
    """Observed and paid as the beam itself, without errors of its sensors, but for who judges the motion."""
    exact = {"sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0, "speed_ripple": 0.0}
    beam = gym.make("chaosgym/ImpactBeam-v1", objective="both", **SHORT, **exact)
    task = beam.unwrapped.task
    same = ("highest_demand", "lowest_demand", "slew_limit", "trim_step", "largest_trim", "smallest_change")
    same = (*RANGE, *same, "largest_change", "start_below", "deviation_weight")
    plant = gym.make(
        "chaosgym/Plant-v0",
        fmu=str(export_fmu(beam.unwrapped.nominal, tmp_path / "beam.fmu", samples=1)),
        input="speed",
        output=["peak_force_upper", "peak_force_lower"],
        arguments={"samples": 1},
        **SHORT,
        **{name: getattr(task, name) for name in same},
    )
    seen = [env.reset(seed=3)[0] for env in (beam, plant)]
    for action in (0, 1, 3, 0, 2, 5, 0, 0, 4, 0, 0, 0):
        np.testing.assert_allclose(seen[0][:6], seen[1][:6], rtol=1e-6)
        (seen[0], *_, ours), (seen[1], *_, theirs) = (env.step(action) for env in (beam, plant))
        for name in ("speed", "demand", "largest_force", "damage", "reward_deviation", "reward_damage", "job_hours"):
            assert theirs[name] == pytest.approx(ours[name], rel=1e-9), name
    assert "judge" not in ours
    assert "nothing labels its motion" in theirs["judge"]
    assert theirs["status"] == ours["status"] == Status.JOB_DONE
    plant.close()


def test_a_motion_is_judged_by_its_own_record():
    """Peaks that repeat cost nothing, at whatever period; those of a logistic map at 4 cost the whole step."""
    x = [0.3]
    for _ in range(999):
        x.append(4.0 * x[-1] * (1.0 - x[-1]))
    jobs = {}
    for name, peaks in {"period 2": [80.0, 120.0] * 500, "chaotic": [100.0 * value for value in x]}.items():
        plant, readings = Told(), iter(peaks)
        plant.run = lambda speed, cycles, readings=readings: [next(readings) for _ in range(cycles)]
        env = made(lambda plant=plant: plant, steps=30, shortest_hold=40, longest_hold=40)
        env.reset(seed=1, options={"speed": 18.0})
        for _ in range(30):
            *_, jobs[name] = env.step(0)
    assert jobs["period 2"]["job_type_iii"] == 0.0
    assert jobs["period 2"]["verdict"].startswith("periodic, period 2")
    assert jobs["chaotic"]["job_type_iii"] > 0.8
    assert jobs["chaotic"]["verdict"].startswith("chaotic")
    assert jobs["chaotic"]["verdict_cycles"] >= 100


def test_what_the_plant_tells_is_observed():
    """Impacts, bouncing and the measured speed; the deviation is that of the measured speed."""
    env = made(lambda: Told(impacts=2.5, bouncing=0.25, speed=17.0))
    observation, _ = env.reset(seed=0)
    names = env.unwrapped.observation_names
    observation, _, _, _, info = env.step(0)
    told = dict(zip(names, observation.tolist(), strict=True))
    assert told["speed"] == info["speed"] == 17.0
    assert info["deviation"] == pytest.approx(abs(17.0 - info["demand"]))
    assert told["impacts_per_cycle"] == pytest.approx(2.5)
    assert told["bouncing_share"] == pytest.approx(0.25)
    assert told["mean_peak_force"] == pytest.approx(80.5)


def test_two_stops_wear_each_by_its_own():
    """Pairs of the largest and the smallest force: the damage is that of the worse stop."""
    env = made(lambda: Told(np.full(1, 180.0)), steps=12)
    env.unwrapped.plant.run = lambda speed, cycles: np.tile([60.0, -180.0], (cycles, 1))
    env.reset(seed=0)
    for _ in range(12):
        *_, info = env.step(0)
    assert info["damage"] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("raises", "the cable is out"),
        ([80.0, np.nan], "told no usable reading for 3 steps; allowed: finite forces below 900 N"),
        ([1e9], "told no usable reading for 3 steps"),
    ],
)
def test_a_plant_that_fails_ends_the_job(fault, why):
    """With the status of a failed simulation, the cost of what is not done, and why; and it is stopped."""
    plant = Told(**({"fails_at": 4} if fault == "raises" else {}))
    env = made(lambda: plant)
    env.reset(seed=0)
    plant.peaks = plant.peaks if fault == "raises" else fault
    for _ in range(12):
        _, _, terminated, _, info = env.step(0)
        if terminated:
            break
    assert info["status"] == Status.SIMULATION_FAILED
    assert info["reward_failure"] < 0.0
    assert why in info["failure"]
    assert plant.stops == 1
    if fault == "raises":
        env.reset(seed=0)


@pytest.mark.parametrize("lost", [[np.nan], [1e9], [80.0, np.nan]])
def test_what_is_no_reading_counts_as_the_one_before(lost):
    """Two steps in a row are paid and observed as the step before them; a stretch of five cycles is a reading."""
    plant, twin = Told(), Told()
    envs = made(lambda: plant), made(lambda: twin)
    for env in envs:
        env.reset(seed=3)
    for step in range(12):
        plant.peaks = lost if step in (4, 5) else [80.0, 81.0] * 4 + [np.inf, np.nan]
        (seen, paid, *_, info), (whole, usual, *_) = (env.step(0) for env in envs)
        np.testing.assert_allclose(seen, whole, rtol=1e-6)
        assert paid == pytest.approx(usual)
    assert info["status"] == Status.JOB_DONE
    assert info["steps_without_reading"] == 2


def test_a_count_that_is_no_number_is_no_reading():
    """The step counts as the one before; no whole number is made of it."""
    plant = Told(impacts=2.0, bouncing=0.2)
    env = made(lambda: plant)
    env.reset(seed=0)
    before = env.step(0)[0]
    plant.extras["impacts"] = np.nan
    np.testing.assert_array_equal(env.step(0)[0][6:], before[6:])


def test_silence_is_said():
    """A plant that tells 0 N for ever may touch nothing, or have a dead sensor: its user is told once."""
    env = made(lambda: Told(np.zeros(1)))
    env.reset(seed=0)
    env.step(0)
    with pytest.warns(UserWarning, match="told 0 N for 3 steps: nothing touches, or the sensor is dead"):
        env.step(0)
    for _ in range(10):
        *_, info = env.step(0)
    assert info["status"] == Status.JOB_DONE


def test_a_start_that_fails_says_why():
    """The plant's own words, and it is stopped."""
    plant = Told(fails_at=1)
    with pytest.raises(SimulationError, match="the cable is out"):
        made(lambda: plant).reset(seed=0)
    assert plant.stops == 1


def test_a_plant_is_stopped_when_its_environment_goes():
    """By Ctrl-C in a step, by a reset in the middle of a job, and by a program that ends without close()."""
    plant = Told()
    env = made(lambda: plant)
    env.reset(seed=0)
    env.reset(seed=1)
    assert plant.stops == 1
    run = plant.run

    def pressed(speed, cycles):
        raise KeyboardInterrupt

    plant.run = pressed
    with pytest.raises(KeyboardInterrupt):
        env.step(0)
    assert plant.stops == 2
    plant.run = run
    env.reset(seed=2)
    del env
    gc.collect()
    assert plant.stops == 3


def test_a_plant_that_can_not_be_copied_is_taken():
    """One with a lock, as a serial port has, given by a method or as an argument."""

    class Port:
        def __init__(self):
            self.lock = threading.Lock()

        def plant(self, port=None):
            """The plant behind it."""
            return Told()

    port = Port()
    env = made(port.plant, arguments={"port": port})
    assert env.unwrapped.spec.kwargs["arguments"]["port"] is port


def test_a_plant_is_stopped_at_the_end_and_by_close():
    """Once for each job that ends, and when the environment is closed in the middle of one."""
    plant = Told()
    env = made(lambda: plant)
    env.reset(seed=0)
    for _ in range(12):
        env.step(0)
    assert plant.stops == 1
    env.reset(seed=1)
    env.close()
    assert plant.stops == 2


@pytest.mark.parametrize(
    ("keywords", "complaint"),
    [
        ({"plant": None}, "a plant is given by fmu=FILE, or by plant="),
        ({"reference_force": None}, "reference_force is missing: of a plant nothing is known"),
        ({"highest_speed": 5.0}, "lowest_speed = 10.0 is out of range; allowed: above 0, below 5.0"),
        ({"unit": "knots"}, "unit = 'knots' is not one of Hz, rpm"),
        ({"wear": 0.1}, "wear = 0.1 is out of range; allowed: 0, for a plant has its own"),
        ({"speed_ripple": 0.01}, "speed_ripple = 0.01 is out of range"),
        ({"clearance": 1e-4}, "clearance is of a machine that is simulated here"),
        ({"render_mode": "rgb_array"}, "render_mode = 'rgb_array' is not possible with a plant"),
        ({"plant": "nowhere:Rig"}, "plant nowhere:Rig failed: ModuleNotFoundError"),
        ({"plant": None, "fmu": "gone.fmu"}, "an FMU needs input=..., its speed, and output=..., its force"),
        ({"stepps": 3}, "unexpected keyword argument 'stepps'; did you mean steps?"),
    ],
)
def test_what_is_not_possible_is_refused(keywords, complaint):
    """In one line that names the keyword."""
    with pytest.raises(ParameterError, match=complaint) as told:
        made(**keywords)
    assert "\n" not in str(told.value)


def test_a_plant_has_no_model():
    """Whoever wants to simulate it, or draw another one, is told so."""
    env = made()
    for use in (lambda: chaosgym.simulate(env.unwrapped.model, 5), lambda: env.unwrapped.model.natural_frequencies):
        with pytest.raises(ParameterError, match="a plant has no model"):
            use()
    with pytest.raises(ParameterError, match="a plant is one machine"):
        env.reset(options={"machine": 3})


def test_several_plants_run_side_by_side():
    """Each sub-environment of a vector has a plant of its own."""
    envs = gym.make_vec("chaosgym/Plant-v0", num_envs=2, plant=Rig, **RANGE, **SHORT)
    observations, infos = envs.reset(seed=[1, 2])
    assert observations.shape == (2, 14)
    assert observations[0, 6] != observations[1, 6]
    assert len(infos["judge"]) == 2
    envs.close()


def test_one_hard_hit_does_not_make_a_step_unusable():
    """The mean of a step counts against the limit of 900 N, not its largest cycle."""
    env = made(Told)
    env.reset(seed=0)
    given = []
    env.unwrapped.plant.run = lambda speed, cycles: given.append([1200.0] + [80.0] * (cycles - 1)) or given[-1]
    observation, *_ = env.step(0)
    told = dict(zip(env.unwrapped.observation_names, observation.tolist(), strict=True))
    assert told["mean_peak_force"] == pytest.approx(np.mean(given[-1]))
