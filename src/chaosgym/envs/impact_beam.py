"""What does an agent do with the Impact Beam System? It sets the frequency at which the beam is shaken."""

from typing import Any

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.machine_env import SENSOR_ERROR, MachineEnv, nominal_machine
from chaosgym.envs.tasks import Task
from chaosgym.envs.vector_env import MachineVectorEnv
from chaosgym.machines.impact_beam import THESIS_IMPACT_BEAM, ImpactBeam

TOLERANCES = {"clearance": 0.2, "damping_ratio": 0.2, "length": 0.002}
"""Half widths as shares of the nominal value. Clearance: +-0.0254 mm at +-0.127 mm, the repeatability of the thesis'
feeler gauges (3.4, printed); damping and length (+-0.56 mm at 279 mm): assumed."""


LOAD_RATING = 67.0
"""Force [N] under which a surface lasts a million cycles; derived: the largest equivalent force of the nominal machine
at constant speed, that of 26.75 Hz."""


class ImpactBeamEnv(MachineEnv):
    """
    ## Description

    A steel beam on a flexure pivot is shaken in the middle, and its tip rattles in the gap between two force sensors:
    the Impact Beam System of P. Gu's thesis (*Chaotic Vibration in Machine Systems and Its Implications for Design*,
    MIT, 1994, chapter 3). The machine has a job of 1000 operating cycles to do. Running fast saves time, but forces
    grow with speed, forces wear the joint out, and above some 18 Hz there are speeds at which the response is chaotic,
    with calm windows between them. The agent sets the speed and finds out.

    The motion is computed exactly between contact events, with the same code that the rest of the package uses; a step
    is a whole number of cycles at constant speed, so the motion goes on across a change of speed without a jump of the
    force's phase.

    ```python
    >>> import gymnasium as gym
    >>> import chaosgym
    >>> env = gym.make("chaosgym/ImpactBeam-v0")
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    ```

    ## Action Space

    The action is an `ndarray` with shape `(1,)` and values in `[-1, 1]`: the target speed, mapped linearly to the range
    of the drive.

    | Num | Action       | Min        | Max        |
    |-----|--------------|------------|------------|
    | 0   | Target speed | -1 (4 Hz)  | +1 (30 Hz) |

    The speed approaches the target by at most 1 Hz a step and is constant within a step. Values beyond the range are
    clipped; an action that is not finite raises an error.

    ## Observation Space

    The observation is an `ndarray` with shape `(13,)`, `(14,)` in Wear; `env.unwrapped.observation_names` names its
    entries. Forces are those of the upper sensor, each peak with an error drawn uniformly from +-3 N and cut off at
    zero. `gymnasium.wrappers.RescaleObservation(env, -1, 1)` brings all entries to one scale.

    | Num  | Observation                                                            | Min | Max | Unit |
    |------|------------------------------------------------------------------------|-----|-----|------|
    | 0    | `speed`: excitation frequency of the step                              | 4   | 30  | Hz   |
    | 1    | `last_action`: the action behind it, clipped                           | -1  | 1   | -    |
    | 2    | `remaining_share`: share of the job still to do                        | 0   | 1   | -    |
    | 3    | `max_peak_force`: largest measured peak force of the step              | 0   | 400 | N    |
    | 4    | `mean_peak_force`: mean of the measured peak forces                    | 0   | 400 | N    |
    | 5    | `std_peak_force`: their standard deviation                             | 0   | 400 | N    |
    | 6    | `impacts_per_cycle`: contacts begun in a cycle, both sensors           | 0   | 200 | -    |
    | 7    | `bouncing_share`: share of the half cycle spent bouncing on one sensor | 0   | 1   | -    |
    | 8-12 | `peak_force_1` ... `peak_force_5`: measured peak force of each cycle   | 0   | 400 | N    |
    | 13   | `damage`: share of its life that the joint has used up, in Wear alone  | 0   | 1   | -    |

    ## Rewards

    The reward of a step of n cycles in a job of N is the sum of four terms, which `info` lists by name:

    | Term              | Value                                                         | Weight w |
    |-------------------|---------------------------------------------------------------|----------|
    | `reward_time`     | -w (duration of the step) / (duration of the job at 30 Hz)    | 1        |
    | `reward_damage`   | -w (increase of the damage of the joint)                      | 1        |
    | `reward_type_iii` | -w n / N if the step counts as Type III                       | 1        |
    | `reward_failure`  | -w on fracture or a failed simulation                         | 10       |

    *Damage* follows the basic rating life of bearings: a cycle with peak force F uses up (F / C)^(10/3) / 10^6 of the
    life of a sensor surface, times an acceleration of 1000. True peak forces count, of the worse surface. C = 67 N is
    the largest equivalent force of the nominal machine at constant speed, that of 26.75 Hz, so that this worst speed
    uses up one life in one job. Several responses coexist near 29 Hz: reached from below, that speed wears more than
    from rest and breaks the joint just before the job ends.

    A step counts as *Type III* if a table of the machine says so: `diagnose` from rest, within 400 cycles, at the
    speeds from 4 to 30 Hz by 0.25 Hz (by 0.5 Hz in Wear, at six clearances from once to twice that of the new machine).
    It counts if the response at the nearest speed is not periodic, or if those at both its neighbours are not. Chaos
    that dies out within the 400 cycles counts as chaos. `env.unwrapped.regimes` is the table of the machine at work,
    `nominal_regimes` that of the nominal one. On the nominal machine 31 % of the speeds are not periodic and 37 %
    count.

    `info["cost"]` is 1 in a step that counts as Type III (`cost_type_iii`), has a peak force above the force limit on
    either sensor (`cost_force`) or fails, and 0 otherwise. `info` also holds `speed` [Hz], `damage`, `machine` (its
    number in the pool), `status` (0 running, 1 job done, 2 fracture, 3 simulation failed) and `is_success`.

    How far the table is right where agents go (`chaosgym regimes check chaosgym/ImpactBeamTolerance-v0`): of 200 steps
    of random jobs on held-out machines, diagnosed from rest at their own speeds within 3200 cycles, 87.5 % agree; 19
    counted though periodic, as a speed between two chaotic ones is meant to, and 6 did not though chaotic.

    Loopholes considered; `chaosgym regimes audit chaosgym/ImpactBeam-v0` plays them for a job each, from 4 Hz on:

    - *Farming*: no term is ever positive, and a job has a fixed number of cycles, so there is nothing to collect.
    - *Standing still*: 4 Hz returns -7.56; the best constant speed, 22.5 Hz, -1.61.
    - *Giving up*: an early end costs 10, more than the rest of any job at 4 Hz. A lowest speed below a tenth of the
      highest would change this.
    - *Dithering* over the edge of a band: every other step counts. The best edge returns -2.22.
    - *Beside an edge*, at a speed that the table still takes for the calm one: -1.75 at the best.
    - *Crossing* bands: going up and down the range as fast as the drive can returns -3.00.
    - *Holding the response periodic by small corrections* (control of chaos) lowers the forces, and so damage, but not
      the Type III term, which knows the speed alone.

    ## Starting State

    The machine starts from rest in the middle of the gap and runs in for 20 cycles at 4 Hz, which the first observation
    reports. `env.reset(options={"speed": 19.0})` starts at another speed, `{"machine": 3}` takes machine 3 of the pool
    instead of one drawn from it.

    ## Episode End

    1. Termination: the job is done.
    2. Termination: fracture, the damage reaches 1.
    3. Termination: the simulation fails; `step` never raises for that.
    4. Truncation: only by `max_episode_steps` of `gymnasium.make`; there is no limit by default, a job has 200 steps.

    ## Arguments

    ```python
    >>> env = gym.make("chaosgym/ImpactBeam-v0", clearance=0.0635e-3)

    ```

    | Parameter         | Type      | Default   | Description                                                  |
    |-------------------|-----------|-----------|--------------------------------------------------------------|
    | `lowest_speed`    | **float** | `4.0`     | target speed of action -1 [Hz]                               |
    | `highest_speed`   | **float** | `30.0`    | target speed of action +1 [Hz]                               |
    | `slew_limit`      | **float** | `1.0`     | largest change of speed in one step [Hz]                     |
    | `cycles_per_step` | **int**   | `5`       | operating cycles in one step                                 |
    | `job_cycles`      | **int**   | `1000`    | operating cycles of the job, a multiple of `cycles_per_step` |
    | `force_limit`     | **float** | `80.0`    | peak force above which a step costs [N]; sensors: 5x         |
    | `pool`            | **str**   | `nominal` | the nominal machine, "training" or "held-out"                |
    | `wear`            | **bool**  | `False`   | the clearance grows with the damage                          |
    | `sensor_error`    | **float** | `3.0`     | half width of the uniform error of a measured peak force [N] |
    | `render_mode`     | **str**   | `None`    | `"rgb_array"` or `"human"`                                   |
    | `fidelity`        | **str**   | `None`    | rung of the ladder of models; none is five plain modes       |
    | any field         | **float** |           | of `chaosgym.ImpactBeam`, in SI units                         |

    The rungs of `fidelity` are `"draft"`, `"standard"`, `"fine"` and `"reference"`; a field that a rung sets may not be
    given beside it.

    Tolerances are +-20 % of the clearance, +-20 % of the damping ratio and +-0.2 % of the length. Their machines are
    fixed and seeded: 128 to train on and 32 held out, in Wear 32 and 16. The agent is not told which machine it got.
    Tables of all of them are shipped; a machine with other fields gets its own when it is first used, which takes
    seconds to minutes and is kept on disk.

    ## Vectorized environment

    ```python
    >>> envs = gym.make_vec("chaosgym/ImpactBeam-v0", num_envs=16, autoreset_mode="SameStep", max_episode_steps=100)
    >>> observations, infos = envs.reset(seed=1)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())

    ```

    All machines step in one compiled call on all processors. Sub-environment i does, bit for bit, what a single
    environment reset with seed + i does, and has a generator of its own. `autoreset_mode` is `"NextStep"` (default),
    `"SameStep"` or `"Disabled"` (with `reset(options={"reset_mask": ...})`); `max_episode_steps` truncates; all other
    keywords are those above, except that there is no rendering. `envs.unwrapped.get_attr(name)` returns `speed`,
    `damage`, `machine`, `regimes`, `nominal_regimes` and `np_random` of each sub-environment, and what they share.
    `reset(options={"machine": [...]})` takes one number for each.

    stable-baselines3 trains on it through its own interface:

    ```python
    from chaosgym.envs import SB3VecEnv
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    PPO("MlpPolicy", VecMonitor(SB3VecEnv("chaosgym/ImpactBeam-v0", num_envs=16))).learn(100_000)
    ```

    The number of threads is numba's (`NUMBA_NUM_THREADS`, `numba.set_num_threads`). With GNU OpenMP underneath, a
    process that was forked after a step can't run this environment itself; spawned workers, and single environments
    in any worker, are not affected. `vectorization_mode="sync"` and `"async"` make single environments instead.

    Where another library makes the environment in a fresh process, the id names the package to import:
    `chaosgym:chaosgym/ImpactBeam-v0`.

    ## Version History

    * v0: Initial version.
    """

    def __init__(
        self,
        *,
        lowest_speed: float = ImpactBeam.usual_ranges[ImpactBeam.speed_field][0],
        highest_speed: float = ImpactBeam.usual_ranges[ImpactBeam.speed_field][1],
        slew_limit: float = 1.0,
        cycles_per_step: int = Task.cycles_per_step,
        job_cycles: int = Task.job_cycles,
        force_limit: float = Task.force_limit,
        pool: str = "nominal",
        wear: bool = False,
        sensor_error: float = SENSOR_ERROR,
        fidelity: str | None = None,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        super().__init__(
            nominal_machine(THESIS_IMPACT_BEAM, {"fidelity": fidelity, **parameters}),
            SpeedDrive(
                lowest_speed=lowest_speed,
                highest_speed=highest_speed,
                slew_limit=slew_limit,
                regime_spacing=0.5 if wear else 0.25,
            ),
            Task(
                job_cycles=job_cycles, cycles_per_step=cycles_per_step, force_limit=force_limit, load_rating=LOAD_RATING
            ),
            tolerances=TOLERANCES,
            pool=pool,
            wear=wear,
            sensor_error=sensor_error,
            render_mode=render_mode,
        )


class ImpactBeamVectorEnv(MachineVectorEnv):
    """Many ``ImpactBeamEnv`` in one compiled call."""

    single = ImpactBeamEnv
