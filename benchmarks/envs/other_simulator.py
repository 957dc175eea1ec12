"""Is a policy worth as much on the same beams in another simulator? Exudyn stands behind the plant interface.

Each job is played twice by ``chaosgym.control.plant.work``, with the same operator, demands, ripple, wear and errors
of the sensors: once on our beam and once on Exudyn's. Nothing was trained or tuned on these machines or in Exudyn.
"""

import json
from collections.abc import Iterable, Mapping
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.control.controllers import Follow, Kriging
from chaosgym.control.operator import Operator
from chaosgym.control.plant import work
from chaosgym.control.policies import shipped_policy
from chaosgym.control.scores import MADE_WORSE, difference
from chaosgym.control.statistics import paired_difference
from chaosgym.envs.exudyn_beam import ExudynBatch
from chaosgym.envs.judge import ExponentJudge
from chaosgym.envs.task import Task
from chaosgym.envs.vector_env import native_envs
from chaosgym.machines.impact_beam import ImpactBeam

Array = NDArray[np.float64]

ENV = "chaosgym/ImpactBeamTolerance-v1"
FLEET: Mapping[str, Any] = {"level": "fleet", "split": "test"}

FIRST_SEED = 22_000_000
"""Of the machines: neither those of a training nor those of another evaluation."""

ZERO = "follow the demand"

PLAYERS: Mapping[str, tuple[Any, str]] = {
    ZERO: (Follow, "irregular"),
    "learned map": (partial(shipped_policy, ENV, "fleet"), "irregular"),
    "kriging, life": (partial(Kriging, price=None), "life"),
}
"""What makes each policy, and the objective that it plays for."""

ONE = np.zeros(1, np.int64)


SIMULATORS: Mapping[str, Any] = {"chaosgym": ImpactBeam.batch, "Exudyn": ExudynBatch}
"""What makes beams in each."""


class Rig:
    """A plant: a beam at work, whose speed ripples, whose clearance grows and whose sensors err as the task says.

    Parameters
    ----------
    kind
        What makes beams, of ``SIMULATORS``.
    machine, task, seed
        The beam, the numbers of its job, and the seed of its disturbances.

    Attributes
    ----------
    irregular, damage
        Share of irregular cycles of each step, and damage of the joint, by true forces.
    """

    def __init__(self, kind: Any, machine: ImpactBeam, task: Task, seed: int) -> None:
        self._kind, self._machine, self._task, self._seed = kind, machine, task, seed

    def reset(self) -> None:
        """Bring the beam to rest."""
        self._beam = self._kind(self._machine, 1)
        self._beam.start(0, self._machine)
        self._judge, self._random = ExponentJudge(1), np.random.default_rng([FIRST_SEED, self._seed])
        self._has_run, self.irregular, self._damage = False, list[float](), np.zeros(2)

    def run(self, speed: float, cycles: int) -> dict[str, Any]:
        """Peaks, impacts and bouncing, as the sensors tell them."""
        task, random = self._task, self._random
        worn = 1.0 + task.wear * len(self.irregular) / task.steps
        speeds = speed * (1.0 + task.speed_ripple * random.standard_normal(cycles))
        self._beam.set_clearances(ONE, np.array([self._machine.clearance * worn]))
        ran, growth = self._beam.run_varied(ONE, speeds[None])
        share, _ = self._judge.verdict(ONE, growth, self._machine.sensed(ran.peak_force))
        if self._has_run:
            self.irregular.append(float(share[0]))
            self._damage += task.damage(ran.peak_force[0])
        self._has_run = True
        impacts, bounced = ran.impacts.sum(), ran.bounce_duration.mean() * 2.0 * speed
        peaks = self._machine.sensed(ran.peak_force[0]) + task.sensor_error * random.uniform(-1.0, 1.0, cycles)
        return {
            "peaks": np.maximum(peaks, 0.0),
            "impacts": float(random.binomial(int(impacts), 1.0 - task.missed_impacts)) / cycles,
            "bouncing": float(np.clip(bounced + task.bouncing_error * random.uniform(-1.0, 1.0), 0.0, 1.0)),
        }

    @property
    def damage(self) -> float:
        """That of the worse surface."""
        return float(self._damage.max())


Given = tuple[int, str, str]


def job(given: Given) -> dict[str, float]:
    """Play one job by its number and the names of a player and a simulator."""
    number, player, simulator = given
    make, objective = PLAYERS[player]
    operator = Operator(make(), ENV, objective=objective, **FLEET)
    task, variants = operator.task, native_envs(ENV, **FLEET).settings.variants
    machine = variants.drawn(np.random.default_rng(FIRST_SEED + number))
    assert isinstance(machine, ImpactBeam)
    rig = Rig(SIMULATORS[simulator], machine, task, number)
    done = work(rig, operator, FIRST_SEED + number, simulator)
    deviation, irregular = float(np.abs(done.speed - done.demand).mean()), float(np.mean(rig.irregular))
    cost = task.steps * (task.deviation_weight * deviation + task.type_iii_weight * irregular)
    lost = cost + task.damage_weight * rig.damage
    return {"return": -lost, "type_iii": irregular, "deviation": deviation, "damage": rig.damage}


def named_job(given: Given) -> tuple[Given, dict[str, float]]:
    """Return what a job was, and what became of it."""
    return given, job(given)


def played(work: Iterable[Given], workers: int, kept: Path) -> dict[Given, dict[str, float]]:
    """Jobs by number, player and simulator; those of a file of lines are read, and each other is added when it ends."""
    lines = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
    told = {(number, player, simulator): found for number, player, simulator, found in map(json.loads, lines)}
    missing = [given for given in work if given not in told]
    kept.parent.mkdir(parents=True, exist_ok=True)
    with get_context("spawn").Pool(workers) as pool, kept.open("a", encoding="utf-8") as file:
        jobs = pool.imap_unordered(named_job, missing)
        for given, found in tqdm(jobs, total=len(missing), desc="jobs", unit="job", leave=False):
            told[given] = found
            print(json.dumps([*given, found]), file=file, flush=True)
    return told


def other_simulator(machines: int, workers: int, kept: Path, players: Iterable[str] = PLAYERS) -> list[dict[str, Any]]:
    """Jobs of each player in both simulators, its life over that of following there, and Exudyn's return less ours."""
    names = list(dict.fromkeys([ZERO, *players]))
    told = played(
        [(k, name, simulator) for k in range(machines) for name in names for simulator in SIMULATORS], workers, kept
    )
    found = []
    for player in names:
        row: dict[str, Any] = {"player": player, "machines": machines}
        for simulator in SIMULATORS:
            mine = [told[k, player, simulator] for k in range(machines)]
            usual = [told[k, ZERO, simulator]["damage"] for k in range(machines)]
            life = float(np.exp(np.mean([np.log(a / b["damage"]) for a, b in zip(usual, mine, strict=True)])))
            row[simulator] = {name: [one[name] for one in mine] for name in mine[0]} | {"life": life}
        ours, theirs = (np.array(row[simulator]["return"]) for simulator in SIMULATORS)
        found.append(row | {"difference": paired_difference(theirs, ours, MADE_WORSE)})
    return found


def lines(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """A Markdown table."""
    heads = [f"{simulator}: return, Type III, off the demand, life" for simulator in SIMULATORS]
    told = [f"| player | machines | {' | '.join(heads)} | Exudyn less chaosgym |", "|---" * 5 + "|"]
    for row in found:
        means = [{name: np.mean(values) for name, values in row[simulator].items()} for simulator in SIMULATORS]
        cells = [
            f"{one['return']:.1f}, {one['type_iii']:.1%}, {one['deviation']:.2f} Hz, x{one['life']:.2f}"
            for one in means
        ]
        told.append(f"| {row['player']} | {row['machines']} | {' | '.join(cells)} | {difference(row['difference'])} |")
    return told
