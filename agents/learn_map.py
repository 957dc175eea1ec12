"""A learned map of a fleet, from jobs at random speeds, to a policy that numpy plays.

    python agents/learn_map.py --keywords '{"level": "fleet", "split": "train"}' --seed 0 --out runs/map-0

Machines run at random speeds around their demand. A network learns to tell what a machine did at every speed where it
was run, before or after, from what had been felt up to some step. No reward is used. The same command goes on with a
run that was interrupted, and ends as if it had not been. Runs of several seeds may play at once; ``--steps 0 --jobs
runs/map-0 runs/map-1`` then fits one map to all their jobs. The folder holds checkpoint.bin (the jobs so far),
progress.csv (a row an epoch, on an eighth of the machines that nothing is fitted to), policy.json and weights.npz.
"""

import argparse
import time
from pathlib import Path
from typing import Any, NamedTuple

from training import CHECKPOINT, keep_arrays, kept_arrays, keywords, run, write_rows

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from tqdm import tqdm, trange

from chaosgym.control.controllers.controller import place_of, seen
from chaosgym.control.policies import save_policy
from chaosgym.control.policies.learned_map import CHANNELS, FeltSpeeds, LearnedMap, readings_of
from chaosgym.control.policies.network import Dense, Network
from chaosgym.envs.vector_env import MachineVectorEnv, native_envs
from chaosgym.errors import ModelFileError

Array = NDArray[Any]

AT_DEMAND = 0.2
"""Part of the moves that go to the demand; the others go anywhere in the band of trims."""

EVERY = 3
"""Steps from one row that is fitted to the next of a job: neighbours are nearly alike."""

MOST = 3.0
"""Settled steps at a speed beyond which its outcome counts no more."""

SMALLEST = 0.1
"""Least load that is told apart from none, in errors of the sensor."""

LOAD_WEIGHT = 0.3
"""Weight of the squared error of the load, in standard deviations, beside the cross-entropy of irregular motion."""

ROW = ("epoch", "irregular", "load", "irregular_unvisited", "processor_seconds")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="Id, or file of a machine.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=300_000, help="Rounded up to whole jobs of all machines.")
    parser.add_argument("--jobs", type=Path, nargs="+", default=[], help="Runs whose jobs are fitted too.")
    parser.add_argument("--out", type=Path, default=Path("runs/map"))
    parser.add_argument("--fidelity", default=None, help="Rung of the machines in training; default: the task's.")
    parser.add_argument("--keywords", type=keywords, default={}, help="Of the environment in training, as JSON.")
    parser.add_argument("--envs", type=int, default=128)
    parser.add_argument("--moves", type=float, default=0.35, help="Part of the steps that go to another speed.")
    parser.add_argument("--batch", type=int, default=512)
    parser.add_argument("--epochs", type=int, default=8)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--dropout", type=float, default=0.4)
    parser.add_argument("--units", type=int, default=256)
    parser.add_argument("--least-gain", type=float, default=0.0, help="Expected, for which it leaves the demand.")
    parser.add_argument("--wary", action="store_true", help="It leaves only a demand that it has felt.")
    return parser.parse_args()


class Jobs(NamedTuple):
    """Jobs of n machines: ``seen`` (steps, n, entries), share ``irregular`` (steps, n), nan at both ends."""

    seen: Array
    irregular: Array


def play(envs: MachineVectorEnv, seed: int, moves: float) -> Jobs:
    """One job on each machine, at random speeds in the band of trims."""
    task, count, generator = envs.task, envs.num_envs, np.random.default_rng(seed)
    wide = round(task.largest_trim / task.trim_step)
    observations, _ = envs.reset(seed=seed)
    kept, irregular = [observations], [np.full(count, np.nan)]
    target, before = np.zeros(count), np.full(count, np.nan)
    for _ in range(task.steps):
        demand = seen(observations, "demand")
        trim = task.trim_step * generator.integers(-wide, wide + 1, count)
        trim[generator.random(count) < AT_DEMAND] = 0.0
        target = np.where((demand != before) | (generator.random(count) < moves), demand + trim, target)
        target, before = target.clip(task.lowest_speed, task.highest_speed), demand
        observations, _, ended, _, info = envs.step(target[:, None].astype(np.float32))
        kept.append(observations)
        irregular.append(np.where(ended, np.nan, info["type_iii"]))
        if ended.all():
            break
    return Jobs(np.array(kept), np.array(irregular, np.float32))


def gathered(asked: argparse.Namespace, envs: MachineVectorEnv) -> Jobs:
    """All jobs, those of other runs too; none that a folder holds is run again."""
    rounds = -(-asked.steps // (envs.num_envs * envs.task.steps))
    known = kept_arrays(asked.out)
    for k in trange(rounds, desc=asked.out.name, unit="round"):
        if f"seen{k}" in known:
            continue
        jobs = play(envs, 1_000_000 * (asked.seed + 1) + k * envs.num_envs, asked.moves)
        known |= {f"{name}{k}": values for name, values in jobs._asdict().items()}
        keep_arrays(asked.out, known)
    parts = _parts(known, rounds)
    for folder in asked.jobs:
        other = kept_arrays(folder)
        parts += _parts(other, len(other) // len(Jobs._fields))
        if not other or parts[-1].seen.shape[::2] != parts[0].seen.shape[::2]:
            raise ModelFileError(f"{folder} holds no jobs of this task; give folders that this script wrote for it")
    if not parts:
        raise ModelFileError("there are no jobs: give --steps, or --jobs with the folders of other runs")
    return Jobs(*(np.concatenate(part, axis=1) for part in zip(*parts, strict=True)))


def _parts(known: dict[str, Array], rounds: int) -> list[Jobs]:
    """Jobs of each round."""
    try:
        return [Jobs(known[f"seen{k}"], known[f"irregular{k}"]) for k in range(rounds)]
    except KeyError as error:
        raise ModelFileError(f"a run's {CHECKPOINT} has no array {error}; it was not written by this script") from None


def usual(envs: MachineVectorEnv, seen_: Array) -> tuple[Array, Array]:
    """Mean and deviation of the readings at each speed (speeds, 5)."""
    rows = seen_.reshape(-1, seen_.shape[-1])
    place, values = place_of(seen(rows, "speed"), envs.task), readings_of(rows, envs.task)
    total = np.zeros((3, len(envs.task.grid), values.shape[1]))
    for k in range(3):
        np.add.at(total[k], place, values**k)
    total += 10.0 * np.array([np.ones(values.shape[1]), values.mean(axis=0), (values**2).mean(axis=0)])[:, None]
    mean = total[1] / total[0]
    return mean, np.sqrt(np.maximum(total[2] / total[0] - mean**2, 0.0)) + 0.1


class Rows(NamedTuple):
    """What is fitted: ``inputs`` of each row and its ``job``; of each job (jobs, speeds) ``weight``, ``share``,
    ``load``."""

    inputs: torch.Tensor
    job: torch.Tensor
    weight: torch.Tensor
    share: torch.Tensor
    load: torch.Tensor


def rows_of(envs: MachineVectorEnv, jobs: Jobs, mean: Array, deviation: Array) -> Rows:
    """Rows of jobs: what was felt up to every third step, and what became of the job at each speed."""
    steps, count = jobs.irregular.shape
    felt, every = FeltSpeeds(envs.task, count, mean, deviation), np.arange(count)
    sums = np.zeros((3, count, len(envs.task.grid)))
    inputs = []
    for step in range(steps):
        row = felt.add(jobs.seen[step])
        if step % EVERY == 0 and step < steps - 1:
            inputs.append(row.astype(np.float16))
        held = felt.settled & np.isfinite(jobs.irregular[step])
        place = place_of(seen(jobs.seen[step], "speed"), envs.task)
        load = np.maximum(seen(jobs.seen[step], "mean_peak_force"), SMALLEST * envs.task.sensor_error)
        values = np.ones(count), jobs.irregular[step], np.log(load)
        for total, value in zip(sums, values, strict=True):
            np.add.at(total, (every[held], place[held]), value[held])
    known = np.maximum(sums[0], 1.0)
    told = (np.minimum(sums[0], MOST), sums[1] / known, sums[2] / known)
    weight, share, load = (torch.as_tensor(values.astype(np.float32)) for values in told)
    return Rows(
        torch.as_tensor(np.concatenate(inputs)), torch.as_tensor(np.tile(every, len(inputs))), weight, share, load
    )


class Losses(NamedTuple):
    """Means over the speeds of some rows: cross-entropy, squared error, and the former where nothing was felt yet."""

    irregular: torch.Tensor
    load: torch.Tensor
    unvisited: torch.Tensor


class Fit:
    """A network that learns rows; ``scale`` of the load is its mean and deviation."""

    def __init__(self, rows: Rows, asked: argparse.Namespace) -> None:
        torch.manual_seed(asked.seed)
        self.rows, self.speeds = rows, rows.weight.shape[1]
        loads = rows.load[rows.weight > 0.0]
        self.scale = float(loads.mean()), float(loads.std())
        width, layers = rows.inputs.shape[1], []
        for _ in range(3):
            layers += [nn.Linear(width, asked.units), nn.ReLU(), nn.Dropout(asked.dropout)]
            width = asked.units
        self.network = nn.Sequential(*layers, nn.Linear(width, 2 * self.speeds))

    def losses(self, chosen: torch.Tensor, hide: bool) -> Losses:
        """Of some rows; ``hide`` forgets a random part of the speeds of each, as if they had not been visited."""
        inputs, job = self.rows.inputs[chosen].float(), self.rows.job[chosen]
        felt, left = inputs[:, :-1].view(len(chosen), self.speeds, CHANNELS), inputs[:, -1:]
        if hide:
            felt = felt * (torch.rand(len(chosen), self.speeds, 1) > torch.rand(len(chosen), 1, 1))
        answer = self.network(torch.cat([felt.flatten(1), left], 1))
        weight = self.rows.weight[job]
        wild = nn.functional.binary_cross_entropy_with_logits(
            answer[:, : self.speeds], self.rows.share[job], reduction="none"
        )
        load = (answer[:, self.speeds :] - (self.rows.load[job] - self.scale[0]) / self.scale[1]) ** 2
        unvisited = weight * (1.0 - felt[:, :, 0])
        return Losses(
            (weight * wild).sum() / weight.sum(),
            (weight * load).sum() / weight.sum(),
            (unvisited * wild).sum() / unvisited.sum().clamp(min=1.0),
        )

    def run(self, asked: argparse.Namespace) -> None:
        """Fit seven eighths of the machines; write how the others are told after each epoch."""
        mine = self.rows.job % 8 != 0
        fitted, others = torch.nonzero(mine)[:, 0], torch.nonzero(~mine)[:, 0]
        optimizer = torch.optim.AdamW(self.network.parameters(), weight_decay=0.01)
        steps = asked.epochs * -(-len(fitted) // asked.batch)
        rate = torch.optim.lr_scheduler.OneCycleLR(optimizer, asked.learning_rate, total_steps=steps, pct_start=0.1)
        told = [ROW]
        for epoch in tqdm(range(asked.epochs), desc="fit", unit="epoch"):
            self.network.train()
            for chosen in fitted[torch.randperm(len(fitted))].split(asked.batch):
                losses = self.losses(chosen, hide=True)
                optimizer.zero_grad()
                (losses.irregular + LOAD_WEIGHT * losses.load).backward()
                optimizer.step()
                rate.step()
            self.network.eval()
            with torch.no_grad():
                parts = [[float(loss) for loss in self.losses(chosen, hide=False)] for chosen in others.split(4096)]
            means = np.round(np.mean(parts, axis=0), 4).tolist()
            told.append((epoch + 1, *means, round(time.process_time())))
        write_rows(asked.out, told)

    def exported(self) -> Network:
        """The network by numpy, its loads as logarithms of the mean peak [log N]."""
        layers = [layer for layer in self.network if isinstance(layer, nn.Linear)]
        arrays = [(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in layers]
        arrays[-1][0][self.speeds :] *= self.scale[1]
        arrays[-1][1][self.speeds :] = arrays[-1][1][self.speeds :] * self.scale[1] + self.scale[0]
        kinds = ["relu"] * (len(arrays) - 1) + ["none"]
        return Network(None, tuple(Dense(*pair, kind) for pair, kind in zip(arrays, kinds, strict=True)))


def train(asked: argparse.Namespace) -> None:
    """Play, fit and write the policy."""
    rung = {} if asked.fidelity is None else {"fidelity": asked.fidelity}
    given = rung | asked.keywords | {"action": "speed"}
    envs = native_envs(asked.env, asked.envs, **given)
    jobs = gathered(asked, envs)
    mean, deviation = usual(envs, jobs.seen)
    if len(mean) * CHANNELS > 10_000:
        raise ModelFileError(f"the task has {len(mean)} speeds; allowed: {10_000 // CHANNELS}")
    fit = Fit(rows_of(envs, jobs, mean, deviation), asked)
    fit.run(asked)
    told = envs.nominal.definition, envs.task.cycles_per_step, asked.least_gain, asked.wary
    save_policy(LearnedMap(asked.env, fit.exported(), mean, deviation, *told), asked.out)
    print(f"policy in {asked.out}")


if __name__ == "__main__":
    run(train, arguments())
