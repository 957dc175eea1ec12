"""Compare controllers and trained policies on the same held-out machines.

    python agents/evaluate.py --env chaosgym/ImpactBeamTolerance-v0 --out runs/evaluation-beam
    python agents/evaluate.py --env chaosgym/ImpactBeamTolerance-v0 --out runs/evaluation-beam --policy "PPO=runs/ppo-*"
    python agents/evaluate.py --env chaosgym/ImpactBeamTolerance-v0 --out runs/evaluation-beam --controllers

Every contender runs one job on each machine, or several on the only one; a training seed of a policy counts as a run of
its own. The folder keeps the jobs of each contender, report.json, table.md and comparison.png. A run that was stopped
goes on with the next job, and a later one adds contenders to those that the folder has.
"""

import argparse
import json
import re
import sys
from collections.abc import Callable
from glob import glob
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym

import chaosgym
from chaosgym.control.comparison import Results, compare, model_gap, reference_of, table_lines
from chaosgym.control.controllers.ladder import LADDER, REFERENCE, SAFE_CONSTANT, each_cycle_keywords
from chaosgym.control.jobs import JobRow, run_jobs
from chaosgym.envs import ENVIRONMENTS
from chaosgym.files import write_atomically

FIRST_SEED = 10_000
"""Of the sensor errors; job i has this seed + i."""

REPEATS = 16
"""Jobs on a machine that is the only one; they differ by their sensor errors."""


class Player(NamedTuple):
    """What ``make`` gives for an environment runs; ``policy`` is the hash of a trained one."""

    make: Callable[[gym.Env[Any, Any]], Any]
    policy: str | None = None


class Contender(NamedTuple):
    """Who runs: ``players`` has an entry for each training seed."""

    knows: str
    players: tuple[Player, ...]
    each_cycle: bool = False


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--env", default="chaosgym/ImpactBeamTolerance-v0", choices=ENVIRONMENTS)
    parser.add_argument(
        "--pool",
        default="held-out",
        choices=("training", "held-out"),
        help="pool of machines; the nominal tasks have one machine",
    )
    parser.add_argument("--machines", type=_number, help="only the first ones of the pool")
    parser.add_argument("--repeats", type=_number, help="jobs on each machine; 16 if there is one machine, else 1")
    parser.add_argument("--controllers", nargs="*", default=list(LADDER), help=f"some of: {', '.join(LADDER)}")
    parser.add_argument(
        "--policy",
        action="append",
        default=[],
        metavar="NAME=FOLDERS",
        help="trained policies: a pattern of folders, one for each training seed; may be given again",
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the comparison")
    parser.add_argument("--json", action="store_true", help="print report.json instead of the table")
    return parser.parse_args()


def _number(text: str) -> int:
    if not (text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 1 on")
    return int(text)


def contenders(arguments: argparse.Namespace) -> dict[str, Contender]:
    """Return the asked controllers and policies by name; those that the scores need are always among them."""
    unknown = set(arguments.controllers) - set(LADDER)
    if unknown:
        raise SystemExit(f"--controllers {', '.join(sorted(unknown))}: unknown; allowed: {', '.join(LADDER)}")
    asked = {*arguments.controllers, SAFE_CONSTANT, REFERENCE}
    chosen = {
        name: Contender(rung.knows, (Player(rung.make),), rung.each_cycle)
        for name, rung in LADDER.items()
        if name in asked
    }
    for given in arguments.policy:
        name, _, pattern = given.partition("=")
        folders = run_folders(pattern)
        if not folders or not re.fullmatch(r"[\w ,.-]+", name) or name in LADDER:
            raise SystemExit(f"--policy {given}: allowed: NAME=FOLDERS, a new name and a pattern that folders match")
        chosen[name] = Contender("tolerance range", tuple(_player(folder) for folder in folders))
    return chosen


def run_folders(pattern: str) -> list[Path]:
    """Return the folders that match, in the order of their training seeds: run-10 comes after run-9."""
    folders = [Path(path) for path in glob(pattern) if Path(path).is_dir()]
    return sorted(folders, key=lambda folder: (len(str(folder)), folder))


def policy_hash(folder: Path) -> str:
    """Return what tells a policy from all others, since policy.json has the hash of its weights."""
    path = folder / "policy.json"
    if not path.is_file():
        raise SystemExit(f"{folder} holds no policy.json; a policy is a folder that a training script has written")
    return sha256(path.read_bytes()).hexdigest()


def _player(folder: Path) -> Player:
    from chaosgym.control.policies import load_policy

    def make(env: gym.Env[Any, Any]) -> Any:
        policy = load_policy(folder)
        policy.fits(env)
        return policy

    return Player(make, policy_hash(folder))


class Comparison:
    """What has to be the same for everybody, and a folder that keeps who ran what."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self._env_id, self._folder = arguments.env, arguments.out / "jobs"
        self._task = {} if _is_nominal(arguments.env) else {"pool": arguments.pool}
        pool: Any = gym.make(arguments.env, **self._task).get_wrapper_attr("pool")
        count = min(len(pool), arguments.machines or len(pool))
        self._machines = list(range(count)) * (arguments.repeats or (REPEATS if count == 1 else 1))
        self._setting = {
            "env": arguments.env,
            "pool": pool.name,
            "machines": count,
            "jobs": len(self._machines),
            "first_seed": FIRST_SEED,
        }

    def results(self, name: str, contender: Contender) -> Results:
        """Return the jobs of a contender, those kept in the folder, or run now."""
        return Results(contender.knows, [self._jobs(name, contender, seed) for seed in range(len(contender.players))])

    def kept(self) -> dict[str, Results]:
        """Return what the folder keeps, by contender."""
        paths = sorted(self._folder.glob("*.json"), key=lambda path: (len(path.name), path.name))
        found: dict[str, Results] = {}
        for path in paths:
            name, content = path.stem.rpartition("-")[0], self._read(path)
            knows, jobs = content["knows"], content["jobs"]
            if len(jobs) < len(self._machines):
                print(f"{path}: {len(jobs)} of {len(self._machines)} jobs; ask for {name} to go on", file=sys.stderr)
                continue
            rows = found[name].rows if name in found else []
            found[name] = Results(knows, [*rows, jobs])
        return found

    def _jobs(self, name: str, contender: Contender, seed: int) -> list[JobRow]:
        path, player = self._folder / f"{name}-{seed}.json", contender.players[seed]
        kept = self._read(path) if path.is_file() else {"jobs": []}
        if kept.get("policy") not in (None, player.policy):
            raise SystemExit(f"{path} has the jobs of another policy; choose another --out, or remove that file")
        jobs: list[JobRow] = kept["jobs"]
        if len(jobs) == len(self._machines):
            return jobs
        path.parent.mkdir(parents=True, exist_ok=True)
        env = gym.make(self._env_id, **self._task)
        if contender.each_cycle:
            env = gym.make(self._env_id, **self._task, **each_cycle_keywords(env))
        runs = run_jobs(env, player.make, self._machines, FIRST_SEED, done=len(jobs), progress=f"{name} {seed}")
        content = {"setting": self._setting, "knows": contender.knows, "policy": player.policy}
        for job in runs:
            jobs.append(job)
            text = json.dumps(content | {"jobs": [each.as_dict() for each in jobs]}) + "\n"
            write_atomically(path, lambda file, text=text: file.write_text(text))
        return jobs

    def _read(self, path: Path) -> dict[str, Any]:
        """What a contender knows, the hash of its policy if it is known, and the jobs that it has done."""
        content: dict[str, Any] = json.loads(path.read_text())
        if content["setting"] != self._setting:
            raise SystemExit(
                f"--out {self._folder.parent} holds another comparison, {content['setting']}; choose another"
            )
        return content | {"jobs": [JobRow(**row) for row in content["jobs"]]}


def _is_nominal(env: str) -> bool:
    return "pool" not in gym.spec(env).kwargs


def main() -> None:
    """Run, compare, print, save."""
    arguments = parse()
    asked, comparison = contenders(arguments), Comparison(arguments)
    results = comparison.kept() | {name: comparison.results(name, each) for name, each in asked.items()}
    summaries = compare(results)
    report = {
        "env": arguments.env,
        "chaosgym": chaosgym.__version__,
        "reference": reference_of(results),
        "gap": model_gap(summaries),
        "contenders": summaries,
    }
    lines = [f"{arguments.env}, {len(next(iter(results.values())).rows[0])} jobs", "", *table_lines(summaries)]
    if report["gap"]:
        lines += [
            "",
            f"Searching with the nominal model costs {report['gap']['gap']:.3f}, "
            f"{report['gap']['share']:.0%} of the safe constant's return.",
        ]
    text = json.dumps(report, indent=1) + "\n"
    write_atomically(arguments.out / "report.json", lambda file: file.write_text(text))
    write_atomically(arguments.out / "table.md", lambda file: file.write_text("\n".join(lines) + "\n"))
    from chaosgym.plotting.comparison import comparison_figure

    figure = comparison_figure(summaries, arguments.env)
    write_atomically(arguments.out / "comparison.png", lambda file: figure.savefig(file, dpi=130, format="png"))
    print(text if arguments.json else "\n".join(lines))


if __name__ == "__main__":
    main()
