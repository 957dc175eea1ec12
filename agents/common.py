"""What do all training scripts share? Arguments, environments, and a folder in which a run is kept and resumed.

A folder holds the policy of the best evaluation, as policy.json and weights.npz for numpy and as policy.zip and
policy_normalisation.npz for stable-baselines3, and config.json, progress.csv (every job) and evaluations.csv. While a
run goes on, checkpoint.zip and checkpoint_normalisation.npz are the last model.
"""

import argparse
import csv
import json
import platform
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numba
import numpy as np
import stable_baselines3
import torch
from shaping import ClairvoyantShaping
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize
from tqdm import tqdm

import chaosgym
from chaosgym.control.policies import save_policy
from chaosgym.control.policies.export import exported
from chaosgym.envs import ENVIRONMENTS, SB3VecEnv
from chaosgym.envs.sb3 import SB3LearnerView
from chaosgym.errors import ParameterError
from chaosgym.files import write_atomically

Arguments = TypeVar("Arguments")

EVALUATION_SEED = 900_000_000
"""First seed of the jobs of the periodic evaluation, far from those of training."""

SEEDS_PER_RUN = 1_000_000
"""Seeds of machines and sensors that a run may use."""

STATISTICS = ("mean", "var", "count")
"""What VecNormalize keeps of observations and returns."""


def parse(kind: type[Arguments], description: str | None) -> Arguments:
    """Read the command line; every field of a dataclass with defaults is an option."""
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    for field in fields(kind):  # type: ignore[arg-type]
        name, default = f"--{field.name.replace('_', '-')}", field.default
        if isinstance(default, bool):
            parser.add_argument(name, action=argparse.BooleanOptionalAction, default=default)
        else:
            choices = get_args(field.type) or None
            parser.add_argument(name, type=type(default), choices=choices, default=default, help="default: %(default)s")
    return kind(**vars(parser.parse_args()))


class Run:
    """A run of training in its folder: new, or one that was interrupted and goes on.

    Parameters
    ----------
    arguments
        A dataclass with at least env, steps, seed, out, envs, memory, increments, shaping, gamma,
        evaluate_every, jobs and threads.
    wrapped
        Puts one more wrapper around the environments of training.
    """

    def __init__(self, arguments: Any, wrapped: Callable[[VecEnv], VecEnv] = lambda envs: envs) -> None:
        self.arguments, self.folder = arguments, Path(arguments.out)
        if arguments.env not in ENVIRONMENTS:
            raise SystemExit(f"--env {arguments.env}: unknown; allowed: {', '.join(ENVIRONMENTS)}")
        torch.set_num_threads(arguments.threads)
        numba.set_num_threads(min(arguments.threads, numba.config.NUMBA_NUM_THREADS))
        try:
            envs: VecEnv = VecMonitor(SB3VecEnv(arguments.env, arguments.envs))
            self._judges = self._seen(SB3VecEnv(arguments.env, arguments.jobs))
        except ParameterError as error:
            raise SystemExit(str(error)) from error
        envs = wrapped(ClairvoyantShaping(envs) if arguments.shaping else envs)
        self.envs = VecNormalize(self._seen(envs), gamma=arguments.gamma)
        self._open_folder()

    def _open_folder(self) -> None:
        arguments, config = asdict(self.arguments), self.folder / "config.json"
        if not self.folder.exists():
            self.folder.mkdir(parents=True)
            content = {"script": Path(sys.argv[0]).name, "arguments": arguments, "versions": _versions()}
            text = json.dumps(content, indent=2) + "\n"
            write_atomically(config, lambda path: path.write_text(text))
        elif not config.is_file() or json.loads(config.read_text())["arguments"] != arguments:
            raise SystemExit(f"--out {self.folder} exists and is not this run; choose another folder")
        elif self._is_finished():
            raise SystemExit(f"--out {self.folder} holds this run, finished; choose another folder")

    def _is_finished(self) -> bool:
        evaluations = self.folder / "evaluations.csv"
        rows = list(csv.DictReader(evaluations.read_text().splitlines())) if evaluations.exists() else []
        return bool(rows) and int(rows[-1]["step"]) >= self.arguments.steps

    def _seen(self, envs: VecEnv) -> VecEnv:
        return SB3LearnerView(envs, self.arguments.memory, self.arguments.increments)

    def resumed(self, kind: type[BaseAlgorithm]) -> Any:
        """Return the model of the last checkpoint, or None if there is none."""
        if not (self.folder / "checkpoint.zip").exists():
            return None
        with np.load(self.folder / "checkpoint_normalisation.npz") as held:
            for name, statistics in (("obs", self.envs.obs_rms), ("ret", self.envs.ret_rms)):
                for part in STATISTICS:
                    setattr(statistics, part, held[f"{name}_{part}"])
        return kind.load(self.folder / "checkpoint.zip", self.envs, device="cpu")

    def learn(self, model: Any) -> None:
        """Train up to the asked number of steps, with progress, checkpoints and evaluations; keep the best policy."""
        arguments = self.arguments
        self.envs.seed(arguments.seed * SEEDS_PER_RUN + model.num_timesteps)
        model.learn(arguments.steps - model.num_timesteps, Watch(self), reset_num_timesteps=False)
        for path in self.folder.glob("checkpoint*"):
            path.unlink()
        print(f"policy, config and progress in {self.folder}")

    def save(self, model: BaseAlgorithm, name: Literal["policy", "checkpoint"]) -> None:
        """Write a model as stable-baselines3 loads it, and the normalisation that belongs to it."""
        held = {
            f"{kind}_{part}": getattr(statistics, part)
            for kind, statistics in (("obs", self.envs.obs_rms), ("ret", self.envs.ret_rms))
            for part in STATISTICS
        }

        def write_arrays(path: Path) -> None:
            with path.open("wb") as file:
                np.savez(file, **held)

        def write_model(path: Path) -> None:
            with path.open("wb") as file:
                model.save(file)

        write_atomically(self.folder / f"{name}_normalisation.npz", write_arrays)
        write_atomically(self.folder / f"{name}.zip", write_model)

    def export(self, model: BaseAlgorithm) -> None:
        """Write the policy as numpy plays it."""
        arguments = self.arguments
        policy = exported(
            model,
            arguments.env,
            self.envs.unwrapped,
            normalise=self.envs,
            memory=arguments.memory,
            increments=arguments.increments,
        )
        save_policy(policy, self.folder)

    def evaluate(self, model: BaseAlgorithm) -> dict[str, float]:
        """Means over one job of each evaluation environment, played without exploration."""
        self._judges.seed(EVALUATION_SEED)
        observations, state, start = self._judges.reset(), None, np.ones(self._judges.num_envs, bool)
        runs, sums = start.copy(), np.zeros((3, len(start)))
        damage, steps = np.zeros(len(start)), np.zeros(len(start))
        while runs.any():
            actions, state = model.predict(self.envs.normalize_obs(observations), state, start, deterministic=True)
            observations, rewards, start, infos = self._judges.step(actions)
            costs = [[info[name] for info in infos] for name in ("cost_type_iii", "cost")]
            sums[:, runs] += np.array([rewards, *costs])[:, runs]
            damage[runs] = np.array([info["damage"] for info in infos])[runs]
            steps += runs
            runs &= ~start
        returns, type_iii, cost = sums
        return {
            "return": float(returns.mean()),
            "type_iii_share": float((type_iii / steps).mean()),
            "cost_share": float((cost / steps).mean()),
            "damage": float(damage.mean()),
        }


class Watch(BaseCallback):
    """Shows progress, writes down every job, now and then evaluates the model, and keeps checkpoint and best policy."""

    def __init__(self, run: Run) -> None:
        super().__init__()
        self.run = run

    def _on_training_start(self) -> None:
        folder, begin = self.run.folder, self.num_timesteps
        self.jobs = _opened(folder / "progress.csv", ["step", "return", "length"], begin)
        self.evaluations = _opened(
            folder / "evaluations.csv", ["step", "return", "type_iii_share", "cost_share", "damage"], begin
        )
        rows = csv.DictReader(self.evaluations.read_text().splitlines())
        self.best = max((float(row["return"]) for row in rows), default=-np.inf)
        self.bar = tqdm(total=self.run.arguments.steps, initial=begin, unit="step", desc=folder.name)
        self.last = begin
        if begin == 0:
            self._evaluate()

    def _on_rollout_start(self) -> None:
        if self.num_timesteps - self.last >= self.run.arguments.evaluate_every:
            self.last = self.num_timesteps
            self._evaluate()
            self.run.save(self.model, "checkpoint")

    def _on_step(self) -> bool:
        self.bar.update(self.num_timesteps - self.bar.n)
        for info in self.locals["infos"]:
            if "episode" in info:
                self._write(self.jobs, [self.num_timesteps, info["episode"]["r"], info["episode"]["l"]])
        return True

    def _on_training_end(self) -> None:
        self._evaluate()
        self.bar.close()

    def _evaluate(self) -> None:
        figures = self.run.evaluate(self.model)
        if figures["return"] > self.best:
            self.best = figures["return"]
            self.run.export(self.model)
            self.run.save(self.model, "policy")
        self._write(self.evaluations, [self.num_timesteps, *(f"{value:.6g}" for value in figures.values())])
        self.bar.set_postfix({name: f"{value:.3f}" for name, value in figures.items()})

    def _write(self, path: Path, row: Iterable[Any]) -> None:
        with path.open("a", newline="") as file:
            csv.writer(file).writerow(row)


def _opened(path: Path, columns: list[str], begin: int) -> Path:
    """A table of rows by step, without those that an interrupted run wrote after its last checkpoint, if it has one."""
    rows = list(csv.reader(path.read_text().splitlines()))[1:] if path.exists() and begin else []
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([columns, *(row for row in rows if int(row[0]) <= begin)])
    return path


def _versions() -> Mapping[str, str]:
    return {
        "chaosgym": chaosgym.__version__,
        "stable_baselines3": stable_baselines3.__version__,
        "torch": torch.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
