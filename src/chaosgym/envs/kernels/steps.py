"""Kernels of a step of k jobs: speed, growth, recurrence, cost and observation, without small arrays.

``tasks`` is ``Task.numbers``, one record; ``jobs`` (N,) are records ``JOB``, ``demands`` (N, steps + 1) the speeds they
are asked for, and ``which`` (k,) the jobs of the step.
"""

from typing import NamedTuple

import numpy as np

from chaosgym.core.kernel import njit
from chaosgym.rating_life import LIFE_EXPONENT

RUNNING, JOB_DONE, FRACTURE, SIMULATION_FAILED, STALLED = range(5)

BY_TRIM, CONTINUOUS, BY_SPEED = range(3)
"""Places of the kinds of action among the choices of a task."""

JOB = np.dtype(
    [(name, np.float64) for name in ("speed", "set_point", "trim", "clearance", "worn")]
    + [(name, np.int64) for name in ("done", "changed", "machine")]
    + [(name, np.float64) for name in ("off", "irregular", "seconds", "largest_force")]
)
"""Speed, set-point of the drive and trim of the last step, clearance when new and as ``worn``, steps ``done``, those
done when the demand ``changed``, and number of the machine; sums so far of deviation, irregular share and time [s], and
largest force [N]."""

TERMS = tuple(f"reward_{term}" for term in ("deviation", "type_iii", "damage", "time", "failure"))

MOTOR = ("set_point", "motor_torque", "motor_power")

SO_FAR = tuple(f"job_{name}" for name in ("deviation", "type_iii", "largest_force", "equivalent_force", "hours"))
"""What the job has come to: means, largest force [N], the constant one that wears as much [N], and time [h]."""

REPORT = np.dtype(
    [(name, np.float64) for name in (*TERMS, "speed", "demand", "deviation", "type_iii", "cost", "irregularity")]
    + [("largest_force", np.float64), ("damage", np.float64), ("status", np.int64), ("is_success", np.bool_)]
    + [("machine", np.int64), ("clearance", np.float64)]
    + [(name, np.float64) for name in (*SO_FAR, *MOTOR)],
    align=True,
)
"""Info of a step, with what a motor adds."""

INFO = (REPORT.names or ())[: -len(MOTOR)]
"""Info of a step at a constant speed."""


class BaseEntries(NamedTuple):
    """Column of each entry that every observation has; entries that a keyword adds follow (``envs.entries``)."""

    speed: int
    demand: int
    trim: int
    offset: int
    remaining_share: int
    steps_since_change: int
    mean_peak_force: int
    std_peak_force: int
    max_peak_force: int
    repeat_1: int
    repeat_2: int
    repeat_4: int
    impacts_per_cycle: int
    bouncing_share: int


PLACE = BaseEntries(*range(len(BaseEntries._fields)))
"""Columns of the entries, by name."""

REPEATS = ((PLACE.repeat_1, 1), (PLACE.repeat_2, 2), (PLACE.repeat_4, 4))
"""Entries that compare measured peaks with those of cycles before, and how many cycles before."""

PERIODS = 8
"""Longest period, in cycles, of a motion that repeats."""


@njit(cache=True)
def limited(value, low, high):
    """Nearest number of a range."""
    return min(max(value, low), high)


@njit(cache=True)
def trimmed(task, action, demand, trim, moves, dead_band):
    """Trim that follows from an action, the demand and the trim before."""
    if task["action"] == BY_SPEED:
        return action[0] - demand
    if task["action"] == BY_TRIM:
        move = int(action[0])
        back = move == len(moves)
        change = task["trim_step"] * moves[0 if back else move]
    else:
        back = action[1] > 0.5
        size = limited((abs(action[0]) - dead_band) / (1.0 - dead_band), 0.0, 1.0)
        change = 2.0 * task["trim_step"] * np.sign(action[0]) * size
    return 0.0 if back else limited(trim + change, -task["largest_trim"], task["largest_trim"])


@njit(cache=True, nogil=True)
def drive(tasks, actions, moves, dead_band, which, demands, jobs):
    """Set trims and set-points by actions (k, n) as in ``envs.drive``, within the drive's range, its rate and its grid.

    A set-point is the speed of a drive without a motor.
    """
    task = tasks[0]
    for k, i in enumerate(which):
        job = jobs[i]
        demand = demands[i, job["done"]]
        job["trim"] = trimmed(task, actions[k], demand, job["trim"], moves, dead_band)
        change = limited(demand + job["trim"] - job["set_point"], -task["slew_limit"], task["slew_limit"])
        moved = job["set_point"] + change
        if task["speed_grid"] > 0.0:
            moved = task["speed_grid"] * np.rint(moved / task["speed_grid"])
        job["speed"] = job["set_point"] = limited(moved, task["lowest_speed"], task["highest_speed"])


@njit(cache=True)
def status_of(steps, outcome, done, damage):
    """Where a job stands, by how its step went (``RUNNING`` if well), steps done, and damage of the joint."""
    if outcome != RUNNING:
        return outcome
    if damage >= 1.0:
        return FRACTURE
    return JOB_DONE if done >= steps else RUNNING


@njit(cache=True)
def rewards_of(task, deviation, type_iii, damage, time, failed, steps_left):
    """Terms of the reward of a step, as in ``TERMS``; their sum is the reward."""
    return (
        0.0 - task["deviation_weight"] * deviation,
        0.0 - task["type_iii_weight"] * type_iii,
        0.0 - task["damage_weight"] * damage,
        0.0 - task["time_weight"] * time,
        0.0 - task["failure_weight"] * steps_left * failed,
    )


@njit(cache=True)
def sum_up(task, job, force, damage, row):
    """Write ``SO_FAR`` of a ``job`` into its ``row``, by the ``damage`` of its joint; forces are shares of ``force``.

    Under the equivalent force in every cycle the damage is the same; it is not a number where no force wears the joint,
    with a ``reference_damage`` of 0.
    """
    done, share = job["done"], task["reference_damage"]
    row["job_deviation"], row["job_type_iii"] = job["off"] / done, job["irregular"] / done
    row["job_largest_force"] = job["largest_force"] * force
    steady = (damage * task["steps"] / done / share) ** (1.0 / LIFE_EXPONENT) if share > 0.0 else np.nan
    row["job_equivalent_force"] = force * task["reference_force"] * steady
    row["job_hours"] = job["seconds"] / 3600.0


@njit(cache=True, nogil=True)
def settle(
    tasks,
    job_time,
    forces,
    which,
    demands,
    outcome,
    peaks,
    wear,
    period,
    type_iii,
    irregularity,
    jobs,
    damage,
    report,
    rewards,
):
    """Count a step as done, and write its ``report`` (k,), records ``REPORT``, and ``rewards`` (k,).

    ``outcome`` as for ``status_of``, ``period`` [s], ``type_iii`` and ``irregularity`` (k,), ``peaks`` (k, cycles,
    sides) as shares of ``forces`` (N,) [N]; ``wear`` (k, sides) adds to ``damage`` (N, sides). ``job_time`` (N,) [s]
    of a job at top speed.
    """
    task = tasks[0]
    for k, i in enumerate(which):
        job, row = jobs[i], report[k]
        demand, steps_left = demands[i, job["done"]], task["steps"] - job["done"]
        before = damage[i].max()
        damage[i] += wear[k]
        job["done"] += 1
        if demands[i, job["done"]] != demand:
            job["changed"] = job["done"]
        job["worn"] = job["clearance"] * (1.0 + task["wear"] * job["done"] / task["steps"])
        row["speed"], row["demand"], row["deviation"] = job["speed"], demand, abs(job["speed"] - demand)
        row["type_iii"] = row["cost"] = 0.0 if outcome[k] != RUNNING else type_iii[k]
        largest, worn = peaks[k].max(), damage[i].max()
        row["irregularity"], row["largest_force"], row["damage"] = irregularity[k], largest * forces[i], worn
        row["status"] = status_of(task["steps"], outcome[k], job["done"], row["damage"])
        row["is_success"] = row["status"] == JOB_DONE
        row["machine"], row["clearance"] = job["machine"], job["worn"]
        duration = task["cycles_per_step"] * period[k]
        job["off"] += row["deviation"]
        job["irregular"] += row["type_iii"]
        job["seconds"] += duration
        job["largest_force"] = max(job["largest_force"], largest)
        sum_up(task, job, forces[i], worn, row)
        worse, time = worn - before, duration / job_time[i]
        gone = row["status"] >= FRACTURE
        terms = rewards_of(task, row["deviation"], row["type_iii"], worse, time, gone, steps_left)
        row["reward_deviation"], row["reward_type_iii"], row["reward_damage"] = terms[:3]
        row["reward_time"], row["reward_failure"] = terms[3:]
        rewards[k] = terms[0] + terms[1] + terms[2] + terms[3] + terms[4]


@njit(cache=True, nogil=True)
def running_exponents(growth, which, memory, largest, exponents, shares):
    """Carry ``exponents`` (N,) through ``growth`` (k, cycles); ``shares`` (k,) of the cycles with a positive one."""
    cycles = growth.shape[1]
    for k, i in enumerate(which):
        exponent, wild = exponents[i], 0
        for grown in growth[k]:
            exponent += (limited(grown, -largest, largest) - exponent) / memory
            wild += exponent > 0.0
        exponents[i] = exponent
        shares[k] = wild / cycles


@njit(cache=True, nogil=True)
def recurrence_misses(peaks, misses):
    """Mean miss at the period that fits best, as a share of the mean peak, (k,), of peak forces (k, cycles)."""
    count, cycles = peaks.shape
    for i in range(count):
        unknown = 0
        while unknown < cycles and np.isnan(peaks[i, unknown]):
            unknown += 1
        lags = min(PERIODS, (cycles - unknown) // 2)
        first = unknown + lags
        total = 0.0
        for cycle in range(first, cycles):
            total += peaks[i, cycle]
        least = np.inf if lags > 0 else 0.0
        for period in range(1, lags + 1):
            miss = 0.0
            for cycle in range(first, cycles):
                miss += abs(peaks[i, cycle] - peaks[i, cycle - period])
            least = min(least, miss)
        misses[i] = least / max(total, 1e-9 * (cycles - first))


@njit(cache=True, nogil=True)
def observe(
    tasks, which, demands, jobs, true_peaks, bounce_duration, period, errors, counted, low, high, measured, values
):
    """Write the observations of the last cycles: ``values`` (k, ``len(PLACE)`` or more), ``measured`` peaks (k, last).

    ``true_peaks`` (k, cycles) where the sensor is, ``bounce_duration`` (k, cycles, sides), ``period`` and ``counted``
    impacts (k,). ``errors`` (k, last + 1) from 0 to 1, of these peaks and of the share of bouncing. ``values`` lie
    between ``low`` and ``high``; columns that are not in ``PLACE`` stay as they are.
    """
    task, last, sides = tasks[0], measured.shape[1], bounce_duration.shape[2]
    first = true_peaks.shape[1] - last
    for k, i in enumerate(which):
        job, peaks, seen = jobs[i], measured[k], values[k]
        total, largest, squares, bouncing = 0.0, 0.0, 0.0, 0.0
        for n in range(last):
            error = (2.0 * errors[k, n] - 1.0) * task["sensor_error"]
            peaks[n] = max(true_peaks[k, first + n] + error, 0.0)
            total += peaks[n]
            largest = max(largest, peaks[n])
            for side in range(sides):
                bouncing += bounce_duration[k, first + n, side]
        mean = total / last
        for n in range(last):
            squares += (peaks[n] - mean) ** 2
        demand = demands[i, job["done"]]
        seen[PLACE.speed], seen[PLACE.demand] = job["speed"], demand
        seen[PLACE.trim], seen[PLACE.offset] = job["trim"], job["speed"] - demand
        seen[PLACE.remaining_share] = 1.0 - job["done"] / task["steps"]
        seen[PLACE.steps_since_change] = min(job["done"] - job["changed"], task["shortest_hold"])
        seen[PLACE.mean_peak_force], seen[PLACE.max_peak_force] = mean, largest
        seen[PLACE.std_peak_force] = np.sqrt(squares / last)
        for column, lag in REPEATS:
            missed = 0.0
            for n in range(lag, last):
                missed += abs(peaks[n] - peaks[n - lag])
            seen[column] = missed / max(1, last - lag)
        seen[PLACE.impacts_per_cycle] = counted[k] / last
        error = (2.0 * errors[k, last] - 1.0) * task["bouncing_error"]
        seen[PLACE.bouncing_share] = 2.0 * bouncing / (last * sides * period[k]) + error
        for column in range(len(PLACE)):
            seen[column] = limited(seen[column], low[column], high[column])
