"""How far do regime tables agree with a full diagnosis where agents go? Speeds that jobs visit, diagnosed themselves.

A table knows a machine at some speeds and clearances, from 400 cycles; a job goes anywhere between them.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from os import cpu_count
from typing import Any

import gymnasium as gym
import numpy as np
from tqdm import tqdm

from chaosgym.envs.pools import worn
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine
from chaosgym.simulation.batch import at_speed

STEPS = 100
"""Steps of each job; a target speed drawn at random is kept for ``HOLD`` of them."""

HOLD = 10


@dataclass(frozen=True)
class RegimeCheck:
    """Numbers of sampled steps, by whether they counted as Type III and what a full diagnosis from rest says."""

    env: str
    seed: int
    periodic: int
    """Not counted, and periodic."""
    irregular: int
    """Counted, and not periodic."""
    missed: int
    """Not counted, though not periodic."""
    blamed: int
    """Counted, though periodic; a periodic speed between two others is meant to."""

    @property
    def samples(self) -> int:
        """Number of steps looked at."""
        return self.periodic + self.irregular + self.missed + self.blamed

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "samples": self.samples, "agreement": (self.periodic + self.irregular) / self.samples}


def check_regimes(env: str, samples: int = 200, seed: int = 0, *, progress: bool = False) -> RegimeCheck:
    """Diagnose, with the full budget, machines as they were in steps that jobs on the held-out pool went through.

    Parameters
    ----------
    env
        Id of an environment with a held-out pool.
    samples
        Steps that are looked at.
    seed
        Of the speeds and of the sample.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ParameterError
        If more steps are asked for than there are.
    """
    visited = _visited(env, seed)
    if not 1 <= samples <= len(visited):
        raise ParameterError(f"samples = {samples} is out of range; allowed: 1 to {len(visited)}")
    chosen = np.random.default_rng(seed).choice(len(visited), samples, replace=False)
    machines = [visited[i][0] for i in chosen.tolist()]
    counted = np.array([visited[i][1] for i in chosen.tolist()])
    with ThreadPoolExecutor(cpu_count()) as threads:
        verdicts = threads.map(_is_periodic, machines)
        bar = tqdm(verdicts, total=samples, desc="diagnose", unit="step", disable=not progress)
        periodic = np.array(list(bar))
    both = [~counted & periodic, counted & ~periodic, ~counted & ~periodic, counted & periodic]
    return RegimeCheck(env, seed, *(int(which.sum()) for which in both))


def _visited(env: str, seed: int) -> list[tuple[Machine, bool]]:
    """Machine of every step, at its speed and clearance, and whether the step counted as Type III."""
    size = len(gym.make(env, pool="held-out").unwrapped.pool)  # type: ignore[attr-defined]
    envs: Any = gym.make_vec(env, num_envs=size, pool="held-out", autoreset_mode="SameStep")
    pool = envs.unwrapped.get_attr("pool")[0]
    envs.reset(seed=seed, options={"machine": np.arange(size)})
    generator = np.random.default_rng(seed)
    visited = []
    for step in range(STEPS):
        if step % HOLD == 0:
            actions = generator.uniform(-1.0, 1.0, (size, 1)).astype(np.float32)
        damage = np.array(envs.unwrapped.get_attr("damage")) if pool.wears else np.zeros(size)
        _, _, ended, _, infos = envs.step(actions)
        rows = zip(infos["machine"], infos["speed"], damage, infos["cost_type_iii"], ~ended, strict=True)
        visited += [
            (at_speed(worn(pool[int(k)], 1.0 + wear), float(speed)), bool(cost))
            for k, speed, wear, cost, goes_on in rows
            if goes_on
        ]
    return visited


def _is_periodic(machine: Machine) -> bool:
    from chaosgym.diagnosis import diagnose

    return diagnose(machine).nature == "periodic"
