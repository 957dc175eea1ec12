"""A sense of irregular motion for a machine: one file, from arguments to a network that numpy asks.

    python agents/learn_sense.py --keywords '{"level": "fleet", "split": "train"}' --seed 0 --out runs/sense-0

Machines run at random speeds around their demand. A small network learns, from statistics of what was felt since the
speed last changed, the share of irregular cycles that the reward charges. Every second round has sensors with another
error. The same command goes on with a run that was interrupted, and ends as if it had not been. The folder holds
checkpoint.bin (the rounds so far), progress.csv (a row an epoch, on an eighth of the machines that nothing is fitted
to) and sense.npz.
"""

import argparse
import time
from pathlib import Path
from typing import Any, NamedTuple

from training import keep_arrays, kept_arrays, keywords, run, write_rows

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import rankdata
from torch import nn
from tqdm import tqdm, trange

from chaosgym.control.controllers.controller import seen
from chaosgym.envs.entries import IrregularProbability
from chaosgym.envs.sense import STATISTICS, Sense, logarithms, save_sense
from chaosgym.envs.vector_env import MachineVectorEnv, native_envs

Array = NDArray[Any]

MOVES = 0.25
"""Part of the steps that go to another speed."""

ERRORS = 0.03, 3.0
"""Range of the sensors' error in every second round, in those of the task."""

FLOOR = 3e-3
"""Added to forces before their logarithm, in reference forces of the task."""

DROPOUT, DECAY = 0.1, 0.01
"""Part of the units that is left out in training, and decay of the weights."""

ROW = ("epoch", "cross_entropy", "area", "processor_seconds")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="Id.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=180_000, help="Rounded up to whole jobs of all machines.")
    parser.add_argument("--out", type=Path, default=Path("runs/sense"))
    parser.add_argument("--keywords", type=keywords, default={}, help="Of the environment, as JSON.")
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--batch", type=int, default=512)
    parser.add_argument("--epochs", type=int, default=12)
    parser.add_argument("--learning-rate", type=float, default=2e-3)
    parser.add_argument("--units", type=int, default=64)
    return parser.parse_args()


class Rows(NamedTuple):
    """Steps: ``statistics`` (n, entries), the ``share`` (n,) that was charged and the number of the ``machine``."""

    statistics: Array
    share: Array
    machine: Array


def environments(asked: argparse.Namespace, error: float) -> MachineVectorEnv:
    """Machines with sensors of another error, as a factor."""
    given = asked.keywords | {"action": "speed", "classifier": "on"}
    task = native_envs(asked.env, 1, **given).task
    return native_envs(asked.env, asked.envs, **given | {"sensor_error": error * task.sensor_error})


def play(asked: argparse.Namespace, round_: int) -> Rows:
    """One job on each machine, at random speeds in the band of trims."""
    generator = np.random.default_rng([asked.seed, round_])
    error = 1.0 if round_ % 2 == 0 else float(np.exp(generator.uniform(*np.log(ERRORS))))
    envs = environments(asked, error)
    (entry,) = (one for one in envs.jobs.entries if isinstance(one, IrregularProbability))
    task, every = envs.task, np.arange(asked.envs)
    wide = round(task.largest_trim / task.trim_step)
    observations, _ = envs.reset(seed=1_000_000 * (asked.seed + 501) + round_ * asked.envs)
    target, before = np.zeros(asked.envs), np.full(asked.envs, np.nan)
    parts = []
    for _ in range(task.steps - 1):
        demand = seen(observations, "demand")
        trim = task.trim_step * generator.integers(-wide, wide + 1, asked.envs)
        target = np.where((demand != before) | (generator.random(asked.envs) < MOVES), demand + trim, target)
        target, before = target.clip(task.lowest_speed, task.highest_speed), demand
        observations, _, ended, _, info = envs.step(target[:, None].astype(np.float32))
        statistics = entry.records.statistics(every)
        told = ~ended & np.isfinite(statistics).all(axis=1)
        machine = round_ * asked.envs + every
        parts.append((statistics[told].astype(np.float32), info["type_iii"][told], machine[told]))
    return Rows(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def gathered(asked: argparse.Namespace) -> Rows:
    """All rounds; none that the folder holds is run again."""
    known = kept_arrays(asked.out)
    rounds = -(-asked.steps // (asked.envs * native_envs(asked.env, 1, **asked.keywords).task.steps))
    for k in trange(rounds, desc=asked.out.name, unit="round"):
        if f"share{k}" in known:
            continue
        known |= {f"{name}{k}": values for name, values in play(asked, k)._asdict().items()}
        keep_arrays(asked.out, known)
    return Rows(*(np.concatenate([known[f"{name}{k}"] for k in range(rounds)]) for name in Rows._fields))


def area(labels: Array, scores: Array) -> float:
    """Area under the curve: the chance that a row with the label (n,) has more of the score (n,) than one without."""
    ranks, with_it = rankdata(scores), int(labels.sum())
    most = with_it * (len(labels) - with_it)
    return float((ranks[labels].sum() - with_it * (with_it + 1) / 2.0) / most) if most else float("nan")


def fit(asked: argparse.Namespace, rows: Rows, floor: float) -> Sense:
    """A sense from seven eighths of the machines; write how the others are told after each epoch."""
    torch.manual_seed(asked.seed)
    logs = logarithms(rows.statistics, floor)
    scale = Sense(floor, logs.mean(axis=0), logs.std(axis=0) + 1e-6, (), ())
    inputs = torch.as_tensor(scale.prepared(rows.statistics).astype(np.float32))
    shares = torch.as_tensor(rows.share.astype(np.float32))
    fitted, others = (torch.as_tensor(np.flatnonzero(mask)) for mask in (rows.machine % 8 != 0, rows.machine % 8 == 0))
    layers: list[nn.Module] = []
    for width in (len(STATISTICS), asked.units):
        layers += [nn.Linear(width, asked.units), nn.ReLU(), nn.Dropout(DROPOUT)]
    network = nn.Sequential(*layers, nn.Linear(asked.units, 1))
    optimizer = torch.optim.AdamW(network.parameters(), weight_decay=DECAY)
    steps = asked.epochs * -(-len(fitted) // asked.batch)
    rate = torch.optim.lr_scheduler.OneCycleLR(optimizer, asked.learning_rate, total_steps=steps)
    told: list[tuple[Any, ...]] = [ROW]
    for epoch in tqdm(range(asked.epochs), desc="fit", unit="epoch"):
        network.train()
        for chosen in fitted[torch.randperm(len(fitted))].split(asked.batch):
            loss = nn.functional.binary_cross_entropy_with_logits(network(inputs[chosen])[:, 0], shares[chosen])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            rate.step()
        network.eval()
        with torch.no_grad():
            answer = network(inputs[others])[:, 0]
        wrong = float(nn.functional.binary_cross_entropy_with_logits(answer, shares[others]))
        reached = area(shares[others].numpy() > 0.5, answer.numpy())
        told.append((epoch + 1, round(wrong, 4), round(reached, 4), round(time.process_time())))
    write_rows(asked.out, told)
    dense = [layer for layer in network if isinstance(layer, nn.Linear)]
    weights, biases = (tuple(getattr(one, name).detach().numpy() for one in dense) for name in ("weight", "bias"))
    return scale._replace(weights=weights, biases=biases)


def train(asked: argparse.Namespace) -> None:
    """Play, fit and write the sense."""
    rows = gathered(asked)
    task = environments(asked, 1.0).task
    sense = fit(asked, rows, FLOOR * task.reference_force)
    about = {"env": asked.env, "keywords": asked.keywords, "seed": asked.seed, "steps": len(rows.share)}
    save_sense(sense, about | {"sees": list(STATISTICS)}, asked.out / "sense.npz")
    print(f"sense in {asked.out}")


if __name__ == "__main__":
    run(train, arguments())
