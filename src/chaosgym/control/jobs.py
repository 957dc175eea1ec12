"""What happened in each job? One row a job, the same machines and sensor errors for everybody."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import gymnasium as gym
from tqdm import tqdm

from chaosgym.envs.tasks import Status


class Policy(Protocol):
    """What sets the speed: a controller or a trained policy."""

    def reset(self) -> None:
        """Begin a job."""
        ...

    def __call__(self, observation: Any) -> Any:
        """Return the action."""
        ...


@dataclass(frozen=True, kw_only=True)
class JobRow:
    """What became of one job.

    ``job_return`` is the sum of its rewards, ``type_iii_share`` and ``cost_share`` are shares of its steps, ``damage``
    is that of the joint at its end, ``cycles`` were done in ``duration`` [s], and ``failed`` tells of a fracture or a
    failed simulation.
    """

    machine: int
    seed: int
    job_return: float
    type_iii_share: float
    cost_share: float
    damage: float
    cycles: int
    duration: float
    failed: bool

    def as_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return asdict(self)


def run_job(env: gym.Env[Any, Any], policy: Policy, machine: int, seed: int) -> JobRow:
    """Run one job on a machine of the environment's pool to its end."""
    observation, _ = env.reset(seed=seed, options={"machine": machine})
    policy.reset()
    unwrapped: Any = env.unwrapped
    cycles_per_step, period_at = unwrapped.task.cycles_per_step, unwrapped.nominal.period_at
    total = duration = 0.0
    steps = type_iii = cost = 0
    ended = False
    while not ended:
        observation, reward, terminated, truncated, info = env.step(policy(observation))
        total += float(reward)
        type_iii += int(info["cost_type_iii"])
        cost += int(info["cost"])
        duration += float(cycles_per_step * period_at(info["speed"]))
        steps += 1
        ended = terminated or truncated
    return JobRow(
        machine=machine,
        seed=seed,
        job_return=total,
        type_iii_share=type_iii / steps,
        cost_share=cost / steps,
        damage=info["damage"],
        cycles=steps * cycles_per_step,
        duration=duration,
        failed=info["status"] in (Status.FRACTURE, Status.SIMULATION_FAILED),
    )


def run_jobs(
    env: gym.Env[Any, Any],
    make_policy: Callable[[gym.Env[Any, Any]], Policy],
    machines: Sequence[int],
    first_seed: int,
    *,
    done: int = 0,
    progress: str | None = None,
) -> Iterator[JobRow]:
    """Run a job on each of some machines of the environment's pool, but for the first ones that are ``done``.

    Job i is reset with ``first_seed`` + i, so that everybody meets the same sensor errors. ``progress`` names a
    progress bar on standard error.
    """
    policy = make_policy(env)
    bar = tqdm(total=len(machines), initial=done, desc=progress, unit="job", disable=progress is None)
    with bar:
        for i in range(done, len(machines)):
            yield run_job(env, policy, machines[i], first_seed + i)
            bar.update()
