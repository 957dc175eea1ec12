"""What does a policy win on machines that are not those it was trained on, and does a guard keep its promise there?

Each row changes what a beam's job rests on, what its sensors tell or what its drive does, for all of the same machines;
fleets are rows too. The promise: nowhere below following the demand by more than the interval of the paired difference.
"""

import json
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.control.controllers import Follow
from chaosgym.control.guard import GuardedPolicy
from chaosgym.control.policies import shipped_policy
from chaosgym.control.readings import FIRST_FELT
from chaosgym.control.rollout import Policy, play
from chaosgym.control.scores import MADE_WORSE, difference
from chaosgym.control.statistics import paired_difference
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.machines.impact_beam import ImpactBeam

Array = NDArray[Any]

ENV, CRANK = "chaosgym/ImpactBeamTolerance-v1", "chaosgym/SliderCrankTolerance-v1"

FIRST_SEED = 23_000_000
"""Of the machines: neither those of training nor those of an evaluation, nor those on which the guard was chosen."""

FORCES = slice(FIRST_FELT, PLACE.impacts_per_cycle)
"""Entries of an observation that are forces."""

OFTEN = 0.1
"""Share of the readings that fail."""

HARDENED, SOFT, WEAK = {"damping_ratio": 0.02}, {"contact_stiffness": 0.75e7}, {"force_amplitude": 16.02}

ROWS: Mapping[str, Mapping[str, Any]] = {
    "as trained": {},
    "structural damping x2": HARDENED,
    "structural damping x0.5": {"damping_ratio": 0.005},
    "structural damping x2, force -10 %": HARDENED | WEAK,
    "contact stiffness x2": {"contact_stiffness": 3.0e7},
    "contact stiffness x0.5": SOFT,
    "contact stiffness x0.5, clearance +15 %": SOFT | {"clearance": 0.14605e-3},
    "contact damping x2": {"contact_damping": 40.0},
    "contact damping x0.5": {"contact_damping": 10.0},
    "force +20 %": {"force_amplitude": 21.36},
    "force -20 %": {"force_amplitude": 14.24},
    "second harmonic of the force, 20 %": {"flaw": "second harmonic"},
    "clearance +30 %": {"clearance": 0.1651e-3},
    "clearance -30 %": {"clearance": 0.0889e-3},
    "density +2 %": {"density": 8007.0},
    "speed ripple 1 %": {"speed_ripple": 0.01},
    "wear of 40 % in a job": {"wear": 0.4},
    "sensor error 3 N": {"sensor_error": 3.0},
    "gain +5 %": {"flaw": "gain +5 %"},
    "gain -5 %": {"flaw": "gain -5 %"},
    "noise of 5 %": {"flaw": "noise of 5 %"},
    "10 % of readings NaN": {"flaw": "NaN"},
    "10 % of readings zero": {"flaw": "zero"},
    "10 % of readings dropped": {"flaw": "dropped"},
    "readings a step late": {"flaw": "late"},
    "the drive lags by half": {"flaw": "lag"},
    "the drive tops out at 20 Hz": {"flaw": "top"},
}

FLEETS: Mapping[str, Mapping[str, Any]] = {
    f"{kind}, {split}": {"env": env, "level": "fleet", "split": split}
    for kind, env in (("beams of the fleet", ENV), ("cranks of the fleet", CRANK))
    for split in ("train", "test", "outside", *(("corner",) if env == ENV else ()))
}
"""Rows of whole fleets; the corner of the cranks costs too much processor time."""


class Flawed:
    """A policy whose sensors or drive have a flaw, the same for every policy of a row.

    ``late`` tells the step before, ``dropped`` the last reading that was not; noise and gain are of the forces. A drive
    that lags does half of the change that is asked of it.
    """

    knows = "measurements"

    def __init__(self, policy: Policy, flaw: str, seed: int = FIRST_SEED) -> None:
        self.policy, self.flaw, self.keywords, self._seed = policy, flaw, policy.keywords, seed

    def start(self, envs: Any) -> None:
        """Begin jobs."""
        self.policy.start(envs)
        self._random, self._last = np.random.default_rng(self._seed), np.zeros((envs.num_envs, 0))

    def __call__(self, observations: Array) -> Array:
        """The policy's actions, as the drive carries them out."""
        actions = np.array(self.policy(self._told(observations)))
        speed = observations[:, PLACE.speed, None]
        if self.flaw == "lag":
            return np.asarray(speed + 0.5 * (actions - speed), np.float32)
        return np.minimum(actions, 20.0) if self.flaw == "top" else actions

    def _told(self, observations: Array) -> Array:
        """Observations with the flaw of the sensors."""
        told, now = observations.copy(), observations[:, FIRST_FELT:].copy()
        drawn = self._random.random(len(told)) < OFTEN
        if self.flaw.startswith("gain"):
            told[:, FORCES] *= 1.05 if "+" in self.flaw else 0.95
        elif self.flaw == "noise of 5 %":
            told[:, FORCES] *= 1.0 + 0.05 * self._random.standard_normal(told[:, FORCES].shape)
        elif self.flaw in ("NaN", "zero"):
            told[drawn, FIRST_FELT:] = np.nan if self.flaw == "NaN" else 0.0
        elif self.flaw in ("late", "dropped") and self._last.size:
            old = drawn if self.flaw == "dropped" else np.ones(len(told), np.bool_)
            told[old, FIRST_FELT:] = self._last[old]
            now = told[:, FIRST_FELT:].copy() if self.flaw == "dropped" else now
        self._last = now
        return told


SECOND = 0.2
"""Amplitude of the second harmonic of the force, over that of the first."""


@contextmanager
def second_harmonic() -> Iterator[None]:
    """Let every impact beam be driven by a second harmonic too, in phase with the first."""
    usual = ImpactBeam.reduce

    def reduce(beam: ImpactBeam) -> Any:
        model = usual(beam)
        return model._replace(drive=np.concatenate([model.drive, SECOND * model.drive], axis=1))

    with patch.object(ImpactBeam, "reduce", reduce):
        yield


PLAYERS = ("follow", "shipped", "guarded")


def returns_of(row: str, seeds: range) -> dict[str, list[float]]:
    """Return of each job of each player, and whether the guard took the machine for a foreign one."""
    changed = {"env": ENV, **{**ROWS, **FLEETS}[row]}
    flaw = changed.pop("flaw", None)
    agent = shipped_policy(changed["env"], changed.get("level"))
    guard = GuardedPolicy(agent)
    returns: dict[str, list[float]] = {}
    for name, player in zip(PLAYERS, (Follow(), agent, guard), strict=True):
        with warnings.catch_warnings(), second_harmonic() if flaw == "second harmonic" else nullcontext():
            warnings.filterwarnings("ignore", "no usable reading")
            played = play(player if flaw is None else Flawed(player, flaw, seeds.start), seeds=seeds, **changed)
        returns[name] = played.returns.tolist()
    return returns | {"foreign": (~guard.trusted).astype(float).tolist()}


def mismatch(machines: int, rows: Iterable[str], kept: Path) -> list[dict[str, Any]]:
    """Differences of the level's shipped policy to following, guarded too, in pairs.

    Jobs in the file ``kept``, a line for each row and run of machines, are not played again; others are added to it.
    """
    told = [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()] if kept.exists() else []
    answer = []
    for row in tqdm(list(rows), desc="rows", unit="row", leave=False):
        parts = sorted((part for part in told if part["row"] == row), key=lambda part: part["first"])
        done = sum(len(part["follow"]) for part in parts)
        if done < machines:
            new = {"row": row, "first": done}
            new |= returns_of(row, range(FIRST_SEED + done, FIRST_SEED + machines))
            kept.parent.mkdir(parents=True, exist_ok=True)
            with kept.open("a", encoding="utf-8") as file:
                print(json.dumps(new), file=file)
            parts.append(new)
        answer.append(_compared(row, parts, machines))
    return answer


def _compared(row: str, parts: list[dict[str, Any]], machines: int) -> dict[str, Any]:
    jobs = {
        name: np.array([value for part in parts for value in part[name]])[:machines] for name in (*PLAYERS, "foreign")
    }
    about: dict[str, Any] = {"row": row, "machines": machines, "foreign": float(jobs.pop("foreign").mean())}
    about["returns"] = {name: float(returns.mean()) for name, returns in jobs.items()}
    return about | {name: paired_difference(jobs[name], jobs["follow"], MADE_WORSE) for name in PLAYERS[1:]}


def lines(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """A Markdown table; what is worse than following beyond the interval is bold."""
    told = ["| machines | follow | shipped less follow | guarded less follow | foreign |", "|---" * 5 + "|"]
    for row in found:
        shipped, guarded = (difference(row[name]) for name in PLAYERS[1:])
        told.append(f"| {row['row']} | {row['returns']['follow']:.1f} | {shipped} | {guarded} | {row['foreign']:.0%} |")
    return told
