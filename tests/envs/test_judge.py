"""The running motion is judged as its exponent and its recurrence say."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.diagnosis import diagnose
from chaosgym.diagnosis.lyapunov import largest_lyapunov_exponent
from chaosgym.envs.judge import MISS, ExponentJudge, RecurrenceJudge, recurrence_miss
from chaosgym.simulation import simulate
from chaosgym.simulation.run import simulate_with_deviations


def _env(machine, speed):
    """A machine without ripple or kicks, held at a speed."""
    keywords = {"action": "speed", "speed_ripple": 0.0, "kick": 0.0, "tolerances": {}}
    env = gym.make(f"chaosgym/{machine}-v1", **keywords)
    env.reset(seed=0, options={"speed": speed})
    for _ in range(12):
        *_, info = env.step(np.array([speed], np.float32))
    return env, info


def test_side_by_side_growth_is_that_of_one_machine():
    """Cycles at speeds of their own, with a deviation, give the bits of ``simulate_with_deviations``."""
    beam = gym.make("chaosgym/ImpactBeam-v1").unwrapped.nominal
    batch, speeds = beam.batch(3), np.random.default_rng(0).uniform(18.0, 30.0, (3, 6))
    for i in range(3):
        batch.start(i, beam)
    cycles, growth = batch.run_varied(np.arange(3), speeds)
    for i in range(3):
        state, deviation = None, np.cos(1.0 + np.arange(beam.n_states))[None]
        for k, speed in enumerate(speeds[i]):
            record, deviation, grown = simulate_with_deviations(beam.at(speed), 1, state, deviations=deviation)
            state = record.final_state
            assert np.array_equal(record.peak_force[0], cycles.peak_force[i, k])
            assert grown[0, 0] == growth[i, k]


@pytest.mark.parametrize("speed", [17.0, 20.0, 21.0, 22.0, 23.5, 24.0])
def test_settled_beams_are_judged_as_they_are_diagnosed(speed):
    """Without ripple the exponent of the running motion has the sign that the diagnosis from rest finds.

    At 18 Hz chaos is transient: how long it lasts hangs on rounding.
    """
    env, info = _env("ImpactBeam", speed)
    nature = diagnose(env.unwrapped.machine, budget=400).nature
    assert info["type_iii"] == (0.0 if nature == "periodic" else 1.0)


def test_the_exponent_is_the_exponent():
    """Averaged over many cycles, the growth is the largest Lyapunov exponent."""
    beam = gym.make("chaosgym/ImpactBeam-v1").unwrapped.nominal.at(27.0)
    settled = simulate(beam, 300).final_state
    *_, growth = simulate_with_deviations(beam, 3000, settled, deviations=np.ones((1, beam.n_states)))
    expected = largest_lyapunov_exponent(beam, cycles=3000).per_cycle
    assert growth[20:].mean() == pytest.approx(expected, abs=0.05)


def test_a_deviation_that_is_damped_is_not_charged():
    """One cycle of strong growth in a calm motion is an eighth of the memory's limit, and soon forgotten."""
    judge, which = ExponentJudge(1), np.zeros(1, np.int64)
    judge.verdict(which, np.full((1, 20), -0.5), np.zeros((1, 20)))
    share, _ = judge.verdict(which, np.array([[3.0] + [-0.5] * 9]), np.zeros((1, 10)))
    assert share[0] == 0.0


@pytest.mark.parametrize("period", [1, 2, 3, 5, 8])
def test_motion_of_a_period_up_to_eight_repeats(period):
    """It misses itself by nothing, whatever the first cycles were; a period of nine misses itself."""
    cycle = np.arange(20)
    peaks = 50.0 + 10.0 * np.cos(2.0 * np.pi * cycle / period)
    assert recurrence_miss(peaks[None])[0] < 1e-12
    assert recurrence_miss(50.0 + 10.0 * (cycle[None] % 9 == 0))[0] > MISS


@pytest.mark.parametrize("cycles", [1, 4, 10])
def test_short_steps_are_judged_with_the_cycles_before_them(cycles):
    """However a motion is cut into steps, its last 20 cycles decide, and nothing of a job before."""
    peaks = 50.0 + np.random.default_rng(0).normal(0.0, 5.0, (1, 40))
    judge, which = RecurrenceJudge(1), np.zeros(1, np.int64)
    for first in range(0, 40, cycles):
        wild, miss = judge.verdict(which, np.empty((1, 0)), peaks[:, first : first + cycles])
    assert (wild[0], miss[0]) == (1.0, recurrence_miss(peaks[:, -20:])[0])
    judge.start(which)
    for _ in range(20):
        wild, miss = judge.verdict(which, np.empty((1, 0)), np.full((1, cycles), 50.0))
        assert (wild[0], miss[0]) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("speed", "irregular", "alarms"), [(19.0, False, False), (23.75, True, True), (23.5, True, False)]
)
def test_the_monitor_tells_what_the_judge_tells(speed, irregular, alarms):
    """With ``monitor="on"`` the last entry is the monitor's level: above 1 on a chaotic beam, below on a periodic.

    At 23.5 Hz peaks vary by less than the sensor's error of 1 N: the judge sees the chaos, the monitor cannot.
    """
    env = gym.make("chaosgym/ImpactBeam-v1", action="speed", speed_ripple=0.0, tolerances={}, monitor="on")
    observation, _ = env.reset(seed=0, options={"speed": speed})
    for _ in range(12):
        observation, *_, info = env.step(np.array([speed], np.float32))
    assert env.observation_space.contains(observation)
    assert (info["type_iii"] > 0.5) == irregular
    assert (observation[env.unwrapped.task.places["monitor_level"]] > 1.0) == alarms


def test_kicks_in_one_call_move_a_crank_as_kicks_cycle_by_cycle():
    """Observations, rewards and forces are equal bit for bit, whether a step is one call or one for each cycle."""

    def played(traced):
        env = gym.make("chaosgym/SliderCrank-v1").unwrapped
        env._job.traced = traced
        steps = [env.reset(seed=3), *(env.step(7 * k % 6) for k in range(12))]
        return [(step[0].tobytes(), *step[1:]) for step in steps]

    assert played(0) == played(1)


@pytest.mark.parametrize(("speed", "nature"), [(12.0, "calm"), (20.6, "irregular")])
def test_the_last_step_is_told_in_the_form_of_every_verdict(speed, nature):
    """At 12 Hz the beam repeats, at 20.6 Hz it is chaotic: a step says so, by the numbers of its info."""
    env, info = _env("ImpactBeam", speed)
    told = env.unwrapped.statement
    assert told.nature == nature == diagnosed(speed)
    assert told.certainty == f"{info['type_iii']:.0%} of the cycles are irregular"
    assert told.reason.endswith(f": {info['irregularity']:.3g}")
    assert told.lines()[0].startswith(f"{nature} (")
    env.reset(seed=1)
    with pytest.raises(gym.error.ResetNeeded, match="no step was run"):
        env.unwrapped.statement  # noqa: B018


def diagnosed(speed):
    """Whether the nominal beam is irregular at a speed, by its diagnosis."""
    beam = gym.make("chaosgym/ImpactBeam-v1").unwrapped.nominal
    return "calm" if diagnose(beam.at(speed), budget=400).nature == "periodic" else "irregular"
