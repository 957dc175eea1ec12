"""A transformer that learns a machine in context, from the jobs that learn_map.py keeps, and plays beside the map.

    python agents/learn_sequence.py --keywords '{"level": "fleet", "split": "train"}' --jobs runs/map-0 --play FILE

After each step of a job it tells what the map tells: the share of irregular cycles and the mean peak at every speed.
Then it learns to name the best speed under the demand too: the cheapest, by what was measured in the whole job and,
where nothing was, by what it tells at the end. A draw of that answer is a draw of the posterior (Lee et al., Supervised
Pretraining Can Learn In-Context Reinforcement Learning, NeurIPS 2023). ``--play`` adds its jobs on machines of the test
split to a file of ``chaosgym compare``. The folder holds checkpoint.bin, the network, and progress.csv.
"""

import argparse
import time
from pathlib import Path
from typing import Any

from training import keep_arrays, kept_arrays, keywords, run, write_rows

import numpy as np
import torch
from learn_map import LOAD_WEIGHT, Array, Jobs, gathered, rows_of, usual
from torch import nn
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy
from tqdm import trange

from chaosgym.control.comparison import compare
from chaosgym.control.controllers.controller import Controller, Observations, place_of, seen
from chaosgym.control.policies.learned_map import FeltSpeeds, LearnedMap
from chaosgym.envs.task import Task
from chaosgym.envs.vector_env import native_envs
from chaosgym.rating_life import damage_in_a_million

LAYERS, JOBS = 3, 32
"""Layers of the transformer, and jobs of a step of its fit."""

ROW = ("epoch", "irregular", "load", "decision", "processor_seconds")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v1", help="Id, or file of a machine.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=Path, nargs="+", required=True, help="Runs of learn_map.py.")
    parser.add_argument("--out", type=Path, default=Path("runs/sequence"))
    parser.add_argument("--keywords", type=keywords, default={}, help="Of the environment in training, as JSON.")
    parser.add_argument("--epochs", type=int, default=12, help="The last third learns the best speed too.")
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--dropout", type=float, default=0.2)
    parser.add_argument("--units", type=int, default=64)
    parser.add_argument("--machines", type=int, default=64, help="How many of the test split play.")
    parser.add_argument("--play", type=Path, default=None, help="File of a comparison on the test split.")
    return parser.parse_args()


def tokens_of(felt: FeltSpeeds, observations: Observations, task: Task) -> Array:
    """What is seen of a step: places of speed and demand, whether it was held, what is left, five readings, (n, 9)."""
    felt.add(observations)
    speed, demand = (place_of(seen(observations, name), task) for name in ("speed", "demand"))
    rest = felt.settled, seen(observations, "remaining_share"), felt.unusual(observations)
    return np.column_stack([speed, demand, *rest]).astype(np.float32)


class Transformer(nn.Module):
    """From the steps of jobs (n, steps, 9) to what is told after each: of every speed, and logits of the best speed.

    ``mean`` and ``deviation`` are what is usual; ``scale`` of the load is its mean and deviation.
    """

    def __init__(self, speeds: int, asked: argparse.Namespace) -> None:
        super().__init__()
        for name, shape in (("mean", (speeds, 5)), ("deviation", (speeds, 5)), ("scale", (2,))):
            self.register_buffer(name, torch.ones(shape, dtype=torch.float64))
        units = asked.units
        self.speed, self.demand = nn.Embedding(speeds, units), nn.Embedding(speeds, units)
        self.rest = nn.Linear(7, units)
        layer = nn.TransformerEncoderLayer(
            units, 4, 4 * units, asked.dropout, "gelu", batch_first=True, norm_first=True
        )
        self.body = nn.TransformerEncoder(layer, LAYERS, nn.LayerNorm(units), enable_nested_tensor=False)
        self.machine = nn.Sequential(nn.Linear(units, 4 * units), nn.GELU(), nn.Linear(4 * units, 2 * speeds))
        self.best = nn.Sequential(nn.Linear(2 * units, 4 * units), nn.GELU(), nn.Linear(4 * units, speeds))

    def forward(self, tokens: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Logit of the irregular share and scaled load (n, steps, 2 speeds), and logits (n, steps, speeds)."""
        speed, demand = (tokens[..., k].long() for k in (0, 1))
        mask = nn.Transformer.generate_square_subsequent_mask(tokens.shape[1])
        told = self.body(self.speed(speed) + self.rest(tokens[..., 2:]), mask=mask, is_causal=True)
        return self.machine(told), self.best(torch.cat([told, self.demand(demand)], -1))


class InContext(LearnedMap):
    """Plays a transformer as a map is played, or goes to a best speed that is ``sampled`` anew for each demand."""

    def __init__(self, env: str, machine: str, network: Transformer, sampled: bool) -> None:
        Controller.__init__(self)
        self.env, self.machine, self.cycles_per_step, self.least_gain = env, machine, 0, 0.0
        self.transformer, self.sampled, self.scale = network.eval(), sampled, network.scale.numpy()
        self.mean, self.deviation = network.mean.numpy(), network.deviation.numpy()

    def begin(self, envs: Any) -> None:
        """Forget the last jobs."""
        super().begin(envs)
        self.generator, self.steps, self.before = np.random.default_rng(0), [], np.full(self.count, np.nan)
        self.noise = np.zeros((self.count, len(self.mean)))

    def read(self, machine: torch.Tensor) -> tuple[Array, Array]:
        """Share of irregular cycles and mean peak [N]."""
        share, load = np.split(machine.numpy().astype(float), 2, axis=-1)
        return 0.5 + 0.5 * np.tanh(0.5 * share), np.exp((load * self.scale[1] + self.scale[0]).clip(-10.0, 20.0))

    def predicted(self, observations: Observations) -> tuple[Array, Array]:
        """As for the map."""
        self.steps.append(tokens_of(self._felt, observations, self.task))
        with torch.no_grad():
            machine, self.logits = (told[:, -1] for told in self.transformer(torch.as_tensor(np.stack(self.steps, 1))))
        return self.read(machine)

    def speeds(self, observations: Observations) -> Array:
        """The speed of least expected cost, or one that is drawn as the best."""
        cheapest = super().speeds(observations)
        if not self.sampled:
            return cheapest
        demand = seen(observations, "demand")
        fresh, self.before = demand != self.before, demand
        self.noise[fresh] = self.generator.gumbel(size=self.noise.shape)[fresh]
        drawn = np.where(within(self.task, demand), self.logits.numpy() + self.noise, -np.inf)
        return np.asarray(self.task.grid[drawn.argmax(axis=1)])


def within(task: Task, demand: Array) -> Array:
    """Speeds within the band of trims around demands (n,), (n, speeds)."""
    return np.abs(task.grid - demand[:, None]) < task.largest_trim + 0.5 * task.trim_step


class Fit:
    """A transformer that learns jobs."""

    def __init__(self, asked: argparse.Namespace, envs: Any, jobs: Jobs) -> None:
        torch.manual_seed(asked.seed)
        mean, deviation = usual(envs, jobs.seen)
        rows = rows_of(envs, jobs, mean, deviation)
        self.weight, self.share = rows.weight, rows.share
        loads = rows.load[rows.weight > 0.0]
        self.load = (rows.load - loads.mean()) / loads.std()
        felt = FeltSpeeds(envs.task, jobs.seen.shape[1], mean, deviation)
        self.tokens = torch.as_tensor(np.stack([tokens_of(felt, step, envs.task) for step in jobs.seen[:-1]], axis=1))
        self.network, self.task = Transformer(len(mean), asked), envs.task
        told = {"mean": mean, "deviation": deviation, "scale": [loads.mean(), loads.std()]}
        self.network.load_state_dict({name: torch.as_tensor(values) for name, values in told.items()}, strict=False)
        self.player = InContext(asked.env, envs.nominal.definition, self.network, sampled=False)
        self.band = torch.as_tensor(within(self.task, self.task.grid))
        self.best: torch.Tensor | None = None

    def hindsight(self) -> torch.Tensor:
        """Place of the best speed of each job under each demand, (jobs, speeds), once the whole job is known."""
        self.network.eval()
        with torch.no_grad():
            machine = torch.cat([self.network(some)[0][:, -1] for some in self.tokens.split(256)])
        share, peak = self.player.read(machine)
        measured = self.weight.numpy() > 0.0
        mean, deviation = self.player.scale
        share = np.where(measured, self.share.numpy(), share)
        peak = np.where(measured, np.exp(self.load.numpy() * deviation + mean), peak)
        lost = damage_in_a_million(peak, self.task.reference_force) * self.task.reference_damage / self.task.steps
        self.player.task, best = self.task, []
        for demand in self.task.grid:
            cost = self.player.cost(share, lost, np.full(len(share), demand), self.task.grid)
            best.append(np.where(within(self.task, np.array([demand])), cost, np.inf).argmin(axis=1))
        return torch.as_tensor(np.stack(best, axis=1))

    def losses(self, chosen: torch.Tensor, hide: bool) -> torch.Tensor:
        """Of some jobs: cross-entropy of irregular motion, squared error of the load, cross-entropy of the best speed.

        ``hide`` forgets a random part of the steps, as if they had not been.
        """
        tokens = self.tokens[chosen]
        if hide:
            left = torch.randperm(tokens.shape[1])[: int(torch.randint(8, tokens.shape[1] + 1, ()))]
            tokens = tokens[:, left.sort().values]
        machine, best = self.network(tokens)
        wild, load = machine.chunk(2, -1)
        weight, share = (values[chosen][:, None].expand_as(wild) for values in (self.weight, self.share))
        total = weight.sum()
        parts = [(weight * binary_cross_entropy_with_logits(wild, share, reduction="none")).sum() / total]
        parts.append((weight * (load - self.load[chosen][:, None]) ** 2).sum() / total)
        if self.best is None:
            return torch.stack([*parts, torch.zeros(())])
        demand = tokens[..., 1].long()
        logits = best.masked_fill(~self.band[demand], -torch.inf)
        return torch.stack([*parts, cross_entropy(logits.flatten(0, 1), self.best[chosen].gather(1, demand).flatten())])

    def run(self, asked: argparse.Namespace) -> None:
        """Fit seven eighths of the jobs; write how the others are told after each epoch."""
        every = torch.arange(len(self.tokens))
        fitted, others = every[every % 8 != 0], every[every % 8 == 0]
        optimizer = torch.optim.AdamW(self.network.parameters(), weight_decay=0.01)
        steps = asked.epochs * -(-len(fitted) // JOBS)
        rate = torch.optim.lr_scheduler.OneCycleLR(optimizer, asked.learning_rate, total_steps=steps, pct_start=0.1)
        rows: list[tuple[Any, ...]] = [ROW]
        bar = trange(asked.epochs, desc="fit", unit="epoch")
        for epoch in bar:
            if epoch == 2 * asked.epochs // 3:
                self.best = self.hindsight()
            self.network.train()
            for chosen in fitted[torch.randperm(len(fitted))].split(JOBS):
                optimizer.zero_grad()
                (self.losses(chosen, hide=True) * torch.tensor([1.0, LOAD_WEIGHT, LOAD_WEIGHT])).sum().backward()
                nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
                optimizer.step()
                rate.step()
            self.network.eval()
            with torch.no_grad():
                told = torch.stack([self.losses(some, hide=False) for some in others.split(256)]).mean(0)
            rows.append((epoch + 1, *(round(float(mean), 4) for mean in told), round(time.process_time())))
            bar.set_postfix_str(" ".join(map(str, rows[-1])))
        write_rows(asked.out, rows)


def train(asked: argparse.Namespace) -> None:
    """Fit, unless the folder holds a network, and play."""
    envs = native_envs(asked.env, 128, **asked.keywords | {"action": "speed"})
    asked.steps = 0  # no jobs of its own
    if not kept_arrays(asked.out):
        fit = Fit(asked, envs, gathered(asked, envs))
        fit.run(asked)
        keep_arrays(asked.out, {name: values.numpy() for name, values in fit.network.state_dict().items()})
    network = Transformer(len(envs.task.grid), asked)
    network.load_state_dict({name: torch.as_tensor(values) for name, values in kept_arrays(asked.out).items()})
    if asked.play is not None:
        names = {"sequence": False, "sequence, sampled": True}
        told = envs.nominal.definition, network
        players = {name: [InContext(asked.env, *told, sampled)] for name, sampled in names.items()}
        on = asked.keywords | {"split": "test"}
        compare(asked.env, asked.play, machines=asked.machines, only=[], policies=players, progress=True, **on)


if __name__ == "__main__":
    run(train, arguments())
