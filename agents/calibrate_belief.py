"""What does a step tell of its speed? Counts on the training pool behind the constants of chaosgym.control.belief.

    python agents/calibrate_belief.py --env chaosgym/SliderCrankTolerance-v0

Jobs wander over the speeds of the table. Of each step the standard deviation of its measured peaks is known, by how
much its share of bouncing differs from that of an earlier step of the stay at that speed, and whether the table calls
it Type III. The log odds of that, less those of all steps, rise with scatter and difference: they are fitted by
isotonic regression and printed at the values that a belief interpolates between.
"""

from dataclasses import dataclass

import common
import gymnasium as gym
import numpy as np
from sklearn.isotonic import IsotonicRegression
from tqdm import trange
from wandering import wandering

from chaosgym.control.belief import COMPARED, DIFFERENCE, SCATTER
from chaosgym.control.machine_search import EQUAL
from chaosgym.envs.observation import BOUNCING, FIRST_PEAK, SPEED

LEAST_SHARE = 0.01
"""Probabilities closer to none or to one are not told apart by so few jobs."""


@dataclass(frozen=True)
class Arguments:
    """Everything that decides the figures."""

    env: str = "chaosgym/ImpactBeamTolerance-v0"
    jobs: int = 128
    seed: int = 0


def felt(arguments: Arguments) -> np.ndarray:
    """Steps of all jobs, (n, 5): earlier steps at this speed, scatter [N], least difference of the share from theirs,
    error of the mean as the table's force [N], Type III."""
    env = gym.make(arguments.env, pool="training").unwrapped
    steps = []
    for job in trange(arguments.jobs, desc="wandering", unit="job"):
        act, ended = wandering(arguments.seed + job), False
        observation = env.reset(seed=arguments.seed + job, options={"machine": job % len(env.pool)})[0]
        stay = [observation[BOUNCING]]
        while not ended:
            before, drive = observation[SPEED], env.drive
            target = env.regimes.speeds[env.regimes.index_of(drive.target_of(act(observation))[1])]
            observation, _, terminated, truncated, _ = env.step(np.array([drive.action_for(target)], np.float32))
            ended = terminated or truncated
            peaks = observation[FIRST_PEAK : FIRST_PEAK + env.task.cycles_per_step].astype(float)
            table, speed = env.regimes, observation[SPEED]
            stay = stay if speed == before else []
            difference = min(np.abs(np.array(stay[-COMPARED:], float) - observation[BOUNCING]), default=np.nan)
            error = peaks.mean() - table.equivalent_force[table.index_of(speed)]
            steps.append((len(stay), peaks.std(), difference, error, table.is_type_iii(speed)))
            stay.append(observation[BOUNCING])
    return np.array(steps, float)


def log_odds(chance: np.ndarray) -> np.ndarray:
    """Return the log odds of probabilities."""
    return np.log(chance / (1.0 - chance))


def evidence(sign: np.ndarray, type_iii: np.ndarray, at: np.ndarray, usual: float) -> str:
    """By how much the log odds of Type III rise above the usual ones with a sign (n,), at some of its values."""
    fit = IsotonicRegression(y_min=LEAST_SHARE, y_max=1.0 - LEAST_SHARE, out_of_bounds="clip").fit(sign, type_iii)
    return ", ".join(f"{value:.1f}" for value in log_odds(fit.predict(at)) - usual)


def main() -> None:
    """Play the jobs and print the counts."""
    arguments = common.parse(Arguments, __doc__)
    pool = gym.make(arguments.env, pool="training").unwrapped.pool
    tables = [table.type_iii for machine in range(len(pool)) for table in pool.regimes(machine)]
    earlier, scatter, difference, error, type_iii = felt(arguments).T
    print(f"Type III: {np.mean(tables):.1%} of the speeds of all tables, {type_iii.mean():.1%} of the steps")
    for name, which in (
        ("whose peaks scatter by less than 2 N", (earlier > 0) & (scatter < 2.0)),
        ("whose share of bouncing repeats one before", difference < EQUAL),
    ):
        told = f"{type_iii[which].mean():.1%} of {np.count_nonzero(which)}" if which.any() else "there are none"
        print(f"Type III among steps at a speed that was kept, {name}: {told}")
    calm, irregular = scatter[type_iii == 0.0], scatter[type_iii == 1.0]
    print(f"scatter of calm steps {np.median(calm):.2f} N, of Type III {np.median(irregular):.2f} N (medians)")
    for name, which in (("moving", earlier == 0), ("staying", earlier > 0)):
        values = evidence(scatter[which], type_iii[which], np.array(SCATTER), log_odds(type_iii[which].mean()))
        print(f"{name}: {values} at {', '.join(map(str, SCATTER))} N, of {np.count_nonzero(which)} steps")
    for name, which in (("first", earlier == 1), ("second", earlier == 2), ("later", earlier > 2)):
        closeness = np.log10(np.maximum(difference[which], DIFFERENCE[0]))
        values = evidence(closeness, type_iii[which], np.log10(DIFFERENCE), log_odds(type_iii.mean()))
        print(f"{name} comparison: {values} at {', '.join(map(str, DIFFERENCE))}, of {np.count_nonzero(which)} steps")
    print(f"error of the mean: {np.sqrt(np.mean(np.clip(error, -20.0, 20.0) ** 2)):.1f} N")


if __name__ == "__main__":
    main()
