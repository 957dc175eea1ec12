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

    The observation is an `ndarray` with shape `(13,)`; `env.unwrapped.observation_names` names its entries. Forces are
    those of the upper sensor, each peak with an error drawn uniformly from +-3 N and cut off at zero.
    `gymnasium.wrappers.RescaleObservation(env, -1, 1)` brings all entries to one scale.

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

    ## Rewards

    The reward of a step of n cycles in a job of N is the sum of four terms, which `info` lists by name:

    | Term              | Value                                                         | Weight w |
    |-------------------|---------------------------------------------------------------|----------|
    | `reward_time`     | -w (duration of the step) / (duration of the job at 30 Hz)    | 1        |
    | `reward_damage`   | -w (increase of the damage of the joint)                      | 1        |
    | `reward_type_iii` | -w n / N if the step counts as Type III                       | 1        |
    | `reward_failure`  | -w on fracture or a failed simulation                         | 10       |

    *Damage* follows the basic rating life of bearings: a cycle with peak force F uses up (F / C)^(10/3) / 10^6 of the
    life of a sensor surface, times an acceleration of 1000. With C = 70 N the worst constant speeds use up 0.8 to 1
    life in one job: 26.6 to 26.8 Hz, and 28.8 to 29.1 Hz, where several periodic responses coexist and rounding
    decides which one is reached. True peak forces count, of the worse surface.

    A step counts as *Type III* if its peak forces don't repeat: the last four true peaks of the upper sensor are
    compared with the four that lie 1, 2, ... 8 cycles before them, and the step repeats if one of these comparisons
    agrees within 5 % of the largest peak (the thesis measured less than 5 % in periodic responses, 3.5.2). Earlier
    cycles count whatever the speed was then; the first cycle of the step, disturbed by the change of speed, is not
    judged.

    How far this agrees with the Two-Step Test on 400 cycles from rest, at constant speeds from 4 to 30 Hz by 0.25 Hz:
    of the steps after the first 100 cycles it marks 1.4 % where the test says periodic (70 speeds; all of the marks
    at 20.25 Hz, period 9) and 67 % where it says chaotic (34 speeds). It marks nine of ten steps of strongly chaotic
    responses; narrow bands, chaos whose peaks stay within 5 %, and what settles after transient chaos pass.

    `info["cost"]` is 1 in a step that counts as Type III (`cost_type_iii`), has a peak force above the force limit on
    either sensor (`cost_force`) or fails, and 0 otherwise. `info` also holds `speed` [Hz], `damage`, `status`
    (0 running, 1 job done, 2 fracture, 3 simulation failed) and `is_success`.

    Loopholes considered:

    - *Farming*: no term is ever positive, and a job has a fixed number of cycles, so there is nothing to collect.
    - *Standing still*: the lowest speed costs 7.5 in time alone, the highest at most 3 without fracture.
    - *Giving up*: an early end costs 10, more than the rest of any job at 4 Hz. A lowest speed below a tenth of the
      highest would change this.
    - *Dithering*: comparing only cycles of equal speed would let small changes of speed wipe out the record, so earlier
      cycles count at any speed. Alternating by 0.05 to 1 Hz about 24, 26.5, 28 and 29.5 Hz leaves 81 to 99 % of the
      steps marked, as do the constant speeds with 84 to 98 %; speeds drawn at random from 22 to 30 Hz, 96 %.
    - *Crossing chaos quickly* and *holding the response periodic by small corrections* (control of chaos) do reduce the
      cost. Both are what one wants.

    ## Starting State

    The machine starts from rest in the middle of the gap and runs in for 20 cycles at 4 Hz, which the first observation
    reports. `env.reset(options={"speed": 19.0})` starts at another speed.

    ## Episode End

    1. Termination: the job is done.
    2. Termination: fracture, the damage reaches 1.
    3. Termination: the simulation fails; `step` never raises for that.
    4. Truncation: only by `max_episode_steps` of `gymnasium.make`; there is no limit by default, a job has 200 steps.

    ## Arguments

    ```python
    >>> env = gym.make("chaosgym/ImpactBeam-v0", clearance=0.0635e-3)

    ```

    | Parameter         | Type            | Default | Description                                                    |
    |-------------------|-----------------|---------|----------------------------------------------------------------|
    | `lowest_speed`    | **float**       | `4.0`   | target speed of action -1 [Hz]                                 |
    | `highest_speed`   | **float**       | `30.0`  | target speed of action +1 [Hz]                                 |
    | `slew_limit`      | **float**       | `1.0`   | largest change of speed in one step [Hz]                       |
    | `cycles_per_step` | **int**         | `5`     | operating cycles in one step                                   |
    | `job_cycles`      | **int**         | `1000`  | operating cycles of the job, a multiple of `cycles_per_step`   |
    | `force_limit`     | **float**       | `80.0`  | peak force above which a step costs [N]; sensors reach 5 times |
    | `pool`            | **str**         | `nominal`| the nominal machine, "training" or "held-out"                  |
    | `wear`            | **bool**        | `False` | the clearance grows with the damage                            |
    | `sensor_error`    | **float**       | `3.0`   | half width of the uniform error of a measured peak force [N]   |
    | `render_mode`     | **str**         | `None`  | `"rgb_array"` or `"human"`                                     |
    | `fidelity`        | **str**         | `None`  | rung of the ladder of models; none is "modes-5"                |
    | any field         | **float**       |         | of `chaosgym.machines.impact_beam.ImpactBeam`, in SI units     |

    The rungs of `fidelity` are `"restitution"`, `"rigid"`, `"modes-3"`, `"modes-5"`, `"modes-8"` and `"reference"`; a
    field that a rung sets may not be given beside it.

    Tolerances are +-20 % of the clearance, +-20 % of the damping ratio and +-0.2 % of the length; a number for
    `tolerance` multiplies them, up to 4. The agent is not told which machine it got.

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
    `damage`, `machine` and `np_random` of each sub-environment, and what they share.

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
            Task(job_cycles=job_cycles, cycles_per_step=cycles_per_step, force_limit=force_limit),
            tolerances=TOLERANCES,
            pool=pool,
            wear=wear,
            sensor_error=sensor_error,
            render_mode=render_mode,
        )


class ImpactBeamVectorEnv(MachineVectorEnv):
    """Many ``ImpactBeamEnv`` in one compiled call."""

    single = ImpactBeamEnv
