"""Put the best policy of some runs into the package, with how it was trained, how it was judged, and a card.

    python agents/ship_policy.py --evaluation runs/evaluation-beam --contender "PPO, belief" --runs "runs/ppo-belief-*"

The best is the one whose periodic evaluation, on machines of the training pool, was best. No held-out machine has a
say. What stable-baselines3 loads to train on goes to agents/policies/, since it contains pickled objects.
"""

import csv
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import common
from evaluate import policy_hash, run_folders
from train_ppo import Arguments as Training

from chaosgym.control.controllers.ladder import SAFE_CONSTANT
from chaosgym.control.policies import load_policy, save_policy
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.files import write_atomically

BESIDE = (SAFE_CONSTANT, "belief programming")
"""Contenders whose figures stand beside those of the policy and of the reference."""

MODEL = ("policy.zip", "policy_normalisation.npz")
"""Files of a run that stable-baselines3 loads."""

SCRIPT = "train_ppo.py"
"""Script whose runs are shipped."""

CARD = Path(__file__).parent / "policy_card.md"

NOTHING_LEARNED = """

**Nothing learned.** Training never improved on the plan that it begins with; this policy is that plan."""
"""What the card of a policy says whose best evaluation was the one before training."""


GIVEN = {
    "none": "the observation alone",
    "speeds": "the observation, and the peak forces felt at each speed",
    "belief": "the observation, and a belief over the map of speeds by what was felt",
    "identified": "the observation, a belief over the map of speeds by what was felt, and the machine's own map "
    "once a simulation repeats what was observed. The search for it takes some ten seconds for a beam and up to "
    "minutes for a crank, or where it fails, and needs the share of bouncing without error, as the task gives it",
}
"""What the card says of each memory."""


@dataclass(frozen=True)
class Arguments:
    """Where the runs and their comparison are, and where policies (into the package) and their models go."""

    evaluation: str = "runs/evaluation"
    contender: str = "PPO"
    runs: str = "runs/ppo-*"
    out: str = str(shipped_folder(""))
    models: str = str(Path(__file__).parent / "policies")


class Best(NamedTuple):
    """The best run: its place among the runs, its folder, return of the evaluation, and steps before it."""

    place: int
    folder: Path
    earned: float
    steps: int


def best_run(pattern: str) -> Best:
    """Return the run with the best evaluation, of folders in the order of evaluate.py."""
    folders = run_folders(pattern)
    if not folders:
        raise SystemExit(f"--runs {pattern}: no folder matches")
    found = [
        Best(place, folder, float(row["return"]), int(row["step"]))
        for place, folder in enumerate(folders)
        for row in csv.DictReader((folder / "evaluations.csv").read_text().splitlines())
    ]
    return max(found, key=lambda one: one.earned)


def described(config: dict[str, Any]) -> dict[str, Any]:
    """Return the record of a run, with the command that repeats it and a folder that means something elsewhere."""
    script = config.get("script", SCRIPT)
    if script != SCRIPT:
        raise SystemExit(f"--runs: a run of {script}; the card tells of {SCRIPT} alone")
    arguments = config["arguments"]
    arguments["out"] = f"runs/{Path(arguments['out']).name}"
    changed = {name: value for name, value in arguments.items() if value != getattr(Training(), name)}
    options = " ".join(_option(name.replace("_", "-"), value) for name, value in changed.items())
    return config | {"command": f"python agents/{SCRIPT} {options}"}


def _option(name: str, value: Any) -> str:
    if isinstance(value, bool):
        return f"--{name}" if value else f"--no-{name}"
    return f"--{name} {value}"


def main() -> None:
    """Choose, copy, describe."""
    asked = common.parse(Arguments, __doc__)
    best, evaluation = best_run(asked.runs), Path(asked.evaluation)
    compared = json.loads((evaluation / "report.json").read_text())
    summaries, reference = compared["contenders"], compared["reference"]
    judged = json.loads((evaluation / "jobs" / f"{asked.contender}-{best.place}.json").read_text())
    if judged.get("policy") not in (None, policy_hash(best.folder)):
        raise SystemExit(f"--evaluation {evaluation} judged another policy than {best.folder}: compare them again")
    figures = {
        name: {key: value for key, value in summaries[name].items() if key not in ("better_than", "profile")}
        for name in (asked.contender, *BESIDE, reference)
    }
    config = described(json.loads((best.folder / "config.json").read_text()))
    own, jobs, arguments = figures.pop(asked.contender), judged["jobs"], config["arguments"]
    score = own["score_by_seed"][best.place]
    report = {
        "setting": judged["setting"],
        "score": score,
        "mean_return": sum(job["job_return"] for job in jobs) / len(jobs),
        "jobs": jobs,
        "all_seeds": own,
        **figures,
    }
    folder = Path(asked.out) / arguments["env"].rpartition("/")[2]
    folder.mkdir(parents=True, exist_ok=True)
    save_policy(load_policy(best.folder), folder)
    card = CARD.read_text().format(
        env=arguments["env"],
        given=GIVEN[arguments["memory"]],
        steps=arguments["steps"],
        seeds=own["seeds"],
        jobs=arguments["jobs"],
        at=best.steps,
        machines=len(jobs),
        pool=judged["setting"]["pool"],
        score=score,
        type_iii=sum(job["type_iii_share"] for job in jobs) / len(jobs),
        safe_iii=figures[SAFE_CONSTANT]["type_iii_share"],
        reference_iii=figures[reference]["type_iii_share"],
        belief=figures["belief programming"]["score"],
        nothing_learned="" if best.steps else NOTHING_LEARNED,
        all_seeds=", ".join(f"{value:.2f}" for value in own["score_by_seed"]),
    )
    written = {"config.json": json.dumps(config, indent=1), "evaluation.json": json.dumps(report, indent=1)}
    for name, text in (written | {"card.md": card.rstrip()}).items():
        write_atomically(folder / name, lambda path, text=text: path.write_text(text + "\n"))
    models = Path(asked.models) / folder.name
    models.mkdir(parents=True, exist_ok=True)
    for name in MODEL:
        write_atomically(models / name, lambda path, name=name: shutil.copyfile(best.folder / name, path))
    print(f"{best.folder} is the policy of {arguments['env']}, in {folder} and {models}")


if __name__ == "__main__":
    main()
