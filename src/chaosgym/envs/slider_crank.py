"""What does an agent do with the Spatial Slider Crank? It sets the speed of the motor that turns the crank."""

from typing import Any

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.machine_env import SENSOR_ERROR, MachineEnv, nominal_machine
from chaosgym.envs.tasks import Task
from chaosgym.envs.vector_env import MachineVectorEnv
from chaosgym.machines.slider_crank import THESIS_SLIDER_CRANK, SliderCrank

SLIDER_CLEARANCE = 0.254e-3
"""Half clearance [m] of the slider joint; printed (thesis figure 4.14b)."""

CONTACT_DAMPING_RATIO = 0.13
"""Assumed: 43 % of the speeds count as Type III, and a sensor with +-3 N of error can feel it. At half the clearance
and 0.105, where 37 % count, the chaotic peaks of 190 rpm lie within 1.2 N of each other, here within 11 N."""

MATRIX_UPDATE_INTERVAL = 5.0
"""Crank angle [deg] over which matrices are held; printed (thesis 5.2.2)."""

FORCE_LIMIT = 120.0
"""Peak force [N] above which a step costs; assumed: the nominal machine passes it from 250 rpm on."""

LOAD_RATING = 141.3
"""Force [N] under which a surface lasts a million cycles; derived: the largest equivalent force of the nominal machine
at constant speed, that of 300 rpm."""

TOLERANCES = {"slider_clearance": 0.1, "ball_clearance": 0.1, "contact_damping_ratio": 0.1, "rod_length": 0.002}
"""Half widths as shares of the nominal value. Clearances: +-0.0254 mm at +-0.254 mm, the repeatability of the thesis'
feeler gauges (3.4, printed); damping and length (+-0.47 mm at 235 mm): assumed. That of the ball joint matters where
it has a clearance, which it has not by default."""


class SliderCrankEnv(MachineEnv):
    """
    ## Description

    A motor turns a crank at constant speed, a slender steel rod drives a slider along a straight guide, and the slider
    rattles in its clearance across the guide: the Spatial Slider Crank of P. Gu's thesis (*Chaotic Vibration in Machine
    Systems and Its Implications for Design*, MIT, 1994, chapter 4). The machine has a job of 1000 revolutions to do.
    Running fast saves time, but forces grow with speed and wear the joint out, and at two fifths of the speeds the
    impacts are irregular, in bands with calm windows between. The agent sets the speed and finds them.

    The motion is computed exactly between contact events, with the same code that the rest of the package uses; a step
    is a whole number of revolutions at constant speed and begins at the outer dead point, so the motion goes on across
    a change of speed without a jump of the crank angle.

    ```python
    >>> import gymnasium as gym
    >>> import chaosgym
    >>> env = gym.make("chaosgym/SliderCrank-v0")
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

    ```

    ## Action Space

    The action is an `ndarray` with shape `(1,)` and values in `[-1, 1]`: the target speed, mapped linearly to the range
    of the drive and rounded to a grid of 2.5 rpm.

    | Num | Action       | Min         | Max          |
    |-----|--------------|-------------|--------------|
    | 0   | Target speed | -1 (50 rpm) | +1 (300 rpm) |

    The speed approaches the target by at most 10 rpm a step and is constant within a step. Values beyond the range are
    clipped; an action that is not finite raises an error. The grid keeps the number of speeds finite, for each of which
    the matrices of the mechanism are assembled once; `speed_grid=0` does without it.

    ## Observation Space

    The observation is an `ndarray` with shape `(13,)`, `(14,)` in Wear; `env.unwrapped.observation_names` names its
    entries. Forces are those that push the slider up, each peak with an error drawn uniformly from +-3 N and cut off at
    zero.
    `gymnasium.wrappers.RescaleObservation(env, -1, 1)` brings all entries to one scale.

    | Num  | Observation                                                           | Min | Max | Unit |
    |------|-----------------------------------------------------------------------|-----|-----|------|
    | 0    | `speed`: crank speed of the step                                      | 50  | 300 | rpm  |
    | 1    | `last_action`: the action behind it, clipped                          | -1  | 1   | -    |
    | 2    | `remaining_share`: share of the job still to do                       | 0   | 1   | -    |
    | 3    | `max_peak_force`: largest measured peak force of the step             | 0   | 600 | N    |
    | 4    | `mean_peak_force`: mean of the measured peak forces                   | 0   | 600 | N    |
    | 5    | `std_peak_force`: their standard deviation                            | 0   | 600 | N    |
    | 6    | `impacts_per_cycle`: contacts begun in a revolution, both surfaces    | 0   | 200 | -    |
    | 7    | `bouncing_share`: share of the half turn spent bouncing on a surface  | 0   | 1   | -    |
    | 8-12 | `peak_force_1` ... `peak_force_5`: measured peak force of each turn   | 0   | 600 | N    |
    | 13   | `damage`: share of its life that the joint has used up, in Wear alone | 0   | 1   | -    |

    ## Rewards

    The reward of a step of n revolutions in a job of N is the sum of four terms, which `info` lists by name:

    | Term              | Value                                                         | Weight w |
    |-------------------|---------------------------------------------------------------|----------|
    | `reward_time`     | -w (duration of the step) / (duration of the job at 300 rpm)  | 1        |
    | `reward_damage`   | -w (increase of the damage of the joint)                      | 1        |
    | `reward_type_iii` | -w n / N if the step counts as Type III                       | 1        |
    | `reward_failure`  | -w on fracture or a failed simulation                         | 10       |

    *Damage* follows the basic rating life of bearings: a revolution with peak force F uses up (F / C)^(10/3) / 10^6 of
    the life of a bearing surface, times an acceleration of 1000. True peak forces count, of the worse surface. C =
    141.3 N is the largest equivalent force of the nominal machine at constant speed, that of 300 rpm, so that this
    worst speed uses up one life in one job.

    A step counts as *Type III* if a table of the machine says so: `diagnose` from rest, within 400 revolutions, at the
    speeds from 50 to 300 rpm by 5 rpm (by 10 rpm in Wear, at six clearances from once to twice that of the new machine;
    2.5 rpm would take 1.5 hours of a core for Tolerance alone). It counts if the response at the nearest speed is not
    periodic, or if those at both its neighbours are not. Chaos that dies out within the 400 revolutions counts as
    chaos. `env.unwrapped.regimes` is the table of the machine at work, `nominal_regimes` that of the nominal one. On
    the nominal machine 39 % of the speeds are not periodic and 43 % count.

    How far the table is right where agents go (`chaosgym regimes check chaosgym/SliderCrankTolerance-v0`): of 200 steps
    of random jobs on held-out machines, diagnosed from rest at their own speeds within 3200 revolutions, 79 % agree; 38
    counted though periodic, and 4 did not though chaotic. Half of these speeds lie between those of the table.

    `info["cost"]` is 1 in a step that counts as Type III (`cost_type_iii`), has a peak force above the force limit on
    either surface (`cost_force`, on the nominal machine from 250 rpm on) or fails, and 0 otherwise. `info` also holds
    `speed` [rpm], `damage`, `machine` (its number in the pool), `status` (0 running, 1 job done, 2 fracture,
    3 simulation failed) and `is_success`.

    Loopholes considered; `chaosgym regimes audit chaosgym/SliderCrank-v0` plays them for a job each, from 50 rpm on:

    - *Farming*: no term is ever positive, and a job has a fixed number of revolutions, so there is nothing to collect.
    - *Standing still*: 50 rpm returns -6.00; the best constant speed, 220 rpm, -1.78.
    - *Giving up*: an early end costs 10, more than the rest of any job at 50 rpm. A lowest speed below a tenth of the
      highest would change this.
    - *Dithering* over the edge of a band: every other step counts. The best edge returns -2.26.
    - *Beside an edge*, at a speed that the table still takes for the calm one: -1.80 at the best.
    - *Crossing* bands: going up and down the range as fast as the drive can returns -2.84.
    - *Holding the response periodic by small corrections* (control of chaos) lowers the forces, and so damage, but not
      the Type III term, which knows the speed alone.

    ## Starting State

    The machine starts from rest in the middle of the gap and runs in for 20 revolutions at 50 rpm, which the first
    observation reports. `env.reset(options={"speed": 190.0})` starts at another speed, rounded to the grid,
    `{"machine": 3}` takes machine 3 of the pool instead of one drawn from it.

    ## Episode End

    1. Termination: the job is done.
    2. Termination: fracture, the damage reaches 1.
    3. Termination: the simulation fails; `step` never raises for that.
    4. Truncation: only by `max_episode_steps` of `gymnasium.make`; there is no limit by default, a job has 200 steps.

    ## Arguments

    ```python
    >>> env = gym.make("chaosgym/SliderCrank-v0", slider_clearance=0.127e-3, rod_diameter=3.175e-3)

    ```

    | Parameter               | Type           | Default    | Description                                           |
    |-------------------------|----------------|------------|-------------------------------------------------------|
    | `lowest_speed`          | **float**      | `50.0`     | target speed of action -1 [rpm]                       |
    | `highest_speed`         | **float**      | `300.0`    | target speed of action +1 [rpm]                       |
    | `slew_limit`            | **float**      | `10.0`     | largest change of speed in one step [rpm]             |
    | `speed_grid`            | **float**      | `2.5`      | spacing of the speeds [rpm], 0 for none               |
    | `cycles_per_step`       | **int**        | `5`        | revolutions in one step                               |
    | `job_cycles`            | **int**        | `1000`     | revolutions of the job, multiple of `cycles_per_step` |
    | `force_limit`           | **float**      | `120.0`    | peak force above which a step costs [N]; sensors: 5x  |
    | `pool`                  | **str**        | `nominal`  | the nominal machine, "training" or "held-out"         |
    | `wear`                  | **bool**       | `False`    | the clearance grows with the damage                   |
    | `sensor_error`          | **float**      | `3.0`      | half width of the error of a measured peak [N]        |
    | `slider_clearance`      | **float**      | `0.000254` | half clearance of the slider joint [m]                |
    | `contact_damping_ratio` | **float**      | `0.13`     | damping ratio of a joint in contact                   |
    | `fidelity`              | **str**        | `None`     | rung of the ladder of models; none is "flexible-5deg" |
    | `render_mode`           | **str**        | `None`     | `"rgb_array"` or `"human"`                            |
    | any field               | **float, str** |            | of `chaosgym.SliderCrank`                             |

    Fields are in SI units, angles in degrees. They include the motor angle, the joints (`slider_joint`, `ball_joint`),
    their clearances, the rod (`rod`, `rod_diameter`, `rod_length`), friction and gravity. The ball joint has no
    clearance, and there is no gravity. Matrices are held over 5 deg of crank angle (`matrix_update_interval`), as in
    the thesis (5.2.2), which makes a new speed cheap. The rungs of `fidelity` are `"rigid"`, `"flexible-5deg"`,
    `"flexible-1deg"` and `"reference"`; a field that a rung sets may not be given beside it.

    The clearance is one of the thesis' (figure 4.14b), the contact damping ratio is assumed. More damping makes
    Type III rare and small, less makes it common. At half of this clearance and a ratio of 0.105, where 37 % of the
    speeds count, the chaotic peaks of 190 rpm lie within 1.2 N of each other, less than the sensor's error, and here
    within 11 N (`chaosgym simulate slider-crank --speed-rpm 190 --fidelity flexible-5deg --clearance-mm 0.254
    --contact-damping-ratio 0.13 --cycles 400`).

    Tolerances are +-10 % of the slider's clearance and of the ball's, +-10 % of the contact damping ratio and +-0.2 %
    of the rod length. Their machines are fixed and seeded: 128 to train on and 32 held out, in Wear 32 and 16. The
    agent is not told which machine it got. Tables of all of them are shipped; a machine with other fields gets its own
    when it is first used, which takes minutes and is kept on disk.

    ## Vectorized environment

    ```python
    >>> envs = gym.make_vec("chaosgym/SliderCrank-v0", num_envs=16, autoreset_mode="SameStep", max_episode_steps=100)
    >>> observations, infos = envs.reset(seed=1)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())

    ```

    All machines step in one compiled call on all processors. Sub-environment i does, bit for bit, what a single
    environment reset with seed + i does, and has a generator of its own. `autoreset_mode` is `"NextStep"` (default),
    `"SameStep"` or `"Disabled"` (with `reset(options={"reset_mask": ...})`); `max_episode_steps` truncates; all other
    keywords are those above, except that there is no rendering. `envs.unwrapped.get_attr(name)` returns `speed`,
    `damage`, `machine`, `regimes`, `nominal_regimes` and `np_random` of each sub-environment, and what they share.
    `reset(options={"machine": [...]})` takes one number for each.

    Machines drawn within tolerances need a model of their own at every new speed, which takes less time than the
    revolutions of a step.

    stable-baselines3 trains on it through its own interface:

    ```python
    from chaosgym.envs import SB3VecEnv
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    PPO("MlpPolicy", VecMonitor(SB3VecEnv("chaosgym/SliderCrank-v0", num_envs=16))).learn(100_000)
    ```

    The number of threads is numba's (`NUMBA_NUM_THREADS`, `numba.set_num_threads`). With GNU OpenMP underneath, a
    process that was forked after a step can't run this environment itself; spawned workers, and single environments
    in any worker, are not affected. `vectorization_mode="sync"` and `"async"` make single environments instead.

    Where another library makes the environment in a fresh process, the id names the package to import:
    `chaosgym:chaosgym/SliderCrank-v0`.

    ## Version History

    * v0: Initial version.
    """

    def __init__(
        self,
        *,
        lowest_speed: float = SliderCrank.usual_ranges[SliderCrank.speed_field][0],
        highest_speed: float = SliderCrank.usual_ranges[SliderCrank.speed_field][1],
        slew_limit: float = 10.0,
        speed_grid: float = 2.5,
        cycles_per_step: int = Task.cycles_per_step,
        job_cycles: int = Task.job_cycles,
        force_limit: float = FORCE_LIMIT,
        pool: str = "nominal",
        wear: bool = False,
        sensor_error: float = SENSOR_ERROR,
        slider_clearance: float = SLIDER_CLEARANCE,
        contact_damping_ratio: float = CONTACT_DAMPING_RATIO,
        fidelity: str | None = None,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        parameters |= {"slider_clearance": slider_clearance, "contact_damping_ratio": contact_damping_ratio}
        if fidelity is None:
            parameters.setdefault("matrix_update_interval", MATRIX_UPDATE_INTERVAL)
        else:
            parameters["fidelity"] = fidelity
        super().__init__(
            nominal_machine(THESIS_SLIDER_CRANK, parameters),
            SpeedDrive(
                lowest_speed=lowest_speed,
                highest_speed=highest_speed,
                slew_limit=slew_limit,
                speed_grid=speed_grid,
                regime_spacing=10.0 if wear else 5.0,
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


class SliderCrankVectorEnv(MachineVectorEnv):
    """Many ``SliderCrankEnv`` in one compiled call."""

    single = SliderCrankEnv
