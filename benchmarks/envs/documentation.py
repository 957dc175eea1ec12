"""The pages of the environments: one of what all tasks share, one for each machine, filled in from the tasks.

python -m benchmarks.envs.documentation docs
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.envs import ENVIRONMENTS
from chaosgym.envs.drive import MOVES
from chaosgym.envs.entries import keywords_of
from chaosgym.envs.judge import ExponentJudge
from chaosgym.envs.levels import LEVELS, task_of, tolerances_of
from chaosgym.envs.observation import MEANINGS
from chaosgym.envs.task import Task
from chaosgym.machines.accuracy import error_spread
from chaosgym.machines.parameters import parameters_of

KINDS = {
    "": "The nominal machine.",
    "Tolerance": "A machine drawn within manufacturing tolerances for each job. The agent is not told which one.",
    "Wear": "A machine drawn within tolerances, whose clearance grows by 10 % in the job, a little at every step.",
}
"""What each task adds, by the end of the id's name."""

ANY_MACHINE = "A machine of a broad family for each job, in shares of its own range of speed and of its rated force."
PLANT = "A machine that is not simulated here: an FMU of another program, or a class of yours."
"""What the ids say of which the page is written by hand."""

MACHINES = {
    "impact-beam": "A steel beam on a flexure pivot is shaken between pivot and tip, and its tip rattles between two "
    "force sensors. It is the Impact Beam System of P. Gu's thesis (MIT, 1994, chapter 3), shaken twice as hard as "
    "there: following the demand is irregular in 21 % of the steps, with the thesis' force in 53 % "
    "([tasks](../development/tasks.md)). Which speeds are calm depends on the clearance, which the mean peak force "
    "tells.",
    "slider-crank": "A motor turns a crank, and a slender steel rod drives a slider along a straight guide. The slider "
    "rattles in its clearance across the guide. It is the Spatial Slider Crank of P. Gu's thesis (MIT, 1994, chapter "
    "4) with the clearance of its figure 4.14b and an assumed damping ratio of the contact.",
}

JUDGES = {
    True: "The motion is judged as it runs. A small deviation travels with it, exactly, through every contact. Its "
    "exponent is the mean over some ten cycles of the logarithm of its growth in a cycle. A cycle in which that is "
    "positive is irregular and costs. What transient motion damps is not charged.",
    False: "The motion is judged as it runs. The peak forces of a step's last cycles are compared with those of the "
    "cycles before. A step is irregular if they differ, at every period up to eight, by more than 2 % of their mean.",
}

ESTIMATED = 32
"""Machines of a task whose error is estimated."""

FOLDER = Path(__file__).parent
COMMON, TEXT = (FOLDER.joinpath(name).read_text(encoding="utf-8") for name in ("task.md", "page.md"))
"""The page of what all tasks share, and that of one machine, with places for what differs."""

REWARDS = {
    "deviation": "-w abs(speed - demand)",
    "type_iii": "-w (share of the step's cycles that are irregular)",
    "damage": "-w (increase of the damage)",
    "time": "-w (duration of the step) / (duration of the job at top speed)",
    "failure": "-w (steps left) on fracture, a stall or a failed simulation",
}
"""Terms of the reward, by the names of their weights."""


def pages() -> Iterator[tuple[str, str]]:
    """Names of the files, and the pages, in the format of Gymnasium's own (Markdown)."""
    known: dict[str, Any] = {}
    links: dict[str, list[str]] = {kind: [] for kind in KINDS}
    for machine, names in _by_machine().items():
        file = f"environments/{machine}.md"
        known[machine] = gym.make(names[0]).unwrapped
        yield file, page(names, known[machine])
        for name in names:
            links[kind_of(name)].append(f"[`{name}`]({file})")
    rows = [f"{', '.join(links[kind])} | {meaning}" for kind, meaning in KINDS.items()]
    rows.append(f"[`chaosgym/AnyMachine-v0`](environments/AnyMachine.md) | {ANY_MACHINE}")
    rows.append(f"[`chaosgym/Plant-v0`](how-to/fmus.md#train-an-agent-on-it) | {PLANT}")
    yield "environments.md", common(rows, known)


def common(rows: list[str], known: dict[str, Any]) -> str:
    """Text of the page of what all tasks share: a column of a table for each machine."""
    task = next(iter(known.values())).task
    weights = [
        " | ".join([f"`reward_{name}`", value, *(f"{getattr(env.task, f'{name}_weight'):g}" for env in known.values())])
        for name, value in REWARDS.items()
    ]
    columns = " | ".join(known)
    units = [f"{_unit(env.nominal)} on {machine}" for machine, env in known.items()]
    return COMMON.format(
        ids=_table("id | task", rows),
        shortest=task.shortest_hold,
        longest=task.longest_hold,
        units=" and in ".join(units),
        size=len(MEANINGS),
        sensor=task.sensor_error,
        bouncing=task.bouncing_error,
        missed=task.missed_impacts,
        life=task.reference_damage,
        observations=_table(f"Num | Observation | {columns}", _observations(list(known.values()))),
        added=_table(f"Keyword | Observation | {columns}", _added([env.task for env in known.values()])),
        rewards=_table(f"Term | Value | w, {columns.replace('| ', '| w, ')}", weights),
        arguments=_table(f"Parameter | {columns} | Description", _arguments([env.task for env in known.values()])),
    )


def _by_machine() -> dict[str, list[str]]:
    """Ids by their machine, such as "ImpactBeam"; its nominal one first."""
    return {
        machine: [name for name in ENVIRONMENTS if name.startswith(f"chaosgym/{machine}")]
        for machine in (name.removeprefix("chaosgym/").split("-")[0] for name in ENVIRONMENTS if not kind_of(name))
    }


def kind_of(name: str) -> str:
    """Return the key of ``KINDS`` for an id."""
    return next((kind for kind in KINDS if kind and f"{kind}-" in name), "")


def page(names: list[str], env: Any) -> str:
    """Text of the page of one machine's ids; the environment is that of the nominal machine."""
    task, nominal = env.task, env.nominal
    unit = _unit(nominal)
    moves = [f"{task.trim_step * move:+g} {unit} of trim" if move else "hold" for move in MOVES]
    noise = []
    if task.speed_ripple:
        noise.append(f"The speed ripples by {task.speed_ripple:.1%} (standard deviation) from cycle to cycle.")
    if task.kick:
        noise.append(f"Velocities are kicked by {task.kick:g} of their range (standard deviation) once a cycle.")
    return TEXT.format(
        title=names[0].removeprefix("chaosgym/").split("-")[0],
        ids=_table(
            "id | level |", [f"`{one}` | `{gym.spec(one).kwargs['level']}` | {KINDS[kind_of(one)]}" for one in names]
        ),
        machine=MACHINES[nominal.name],
        unit=unit,
        actions=_table("Num | Action", [f"{k} | {move}" for k, move in enumerate([*moves, "back to the demand"])]),
        low=task.lowest_speed,
        high=task.highest_speed,
        grid=f", on a grid of {task.speed_grid:g} {unit}" if task.speed_grid else "",
        judge=JUDGES[isinstance(env._job.judge, ExponentJudge)],
        start=task.start_below,
        run_in=task.run_in_cycles,
        steps=task.steps,
        cycles=task.cycles_per_step,
        levels=_table("level | tolerances | growth of the clearance in a job", _levels(nominal)),
        disturbance=" ".join(noise),
        rung=nominal.rung or "none",
        error=_errors(names, env),
        model=_model(env),
    )


def _errors(names: list[str], env: Any) -> str:
    """Estimated errors of the rung at machines and speeds of the level that varies most."""
    fleet: Any = gym.make(names[0], level="fleet").unwrapped
    variants = fleet.settings.variants
    random = np.random.default_rng(0)
    speeds = random.uniform(env.task.lowest_speed, env.task.highest_speed, ESTIMATED)
    return error_spread([variants.drawn(random).at(speed) for speed in speeds.tolist()]).line


def _unit(nominal: Any) -> str:
    """Unit of the machine's speed."""
    return parameters_of(nominal)[nominal.speed_field].unit


def _table(head: str, rows: list[str]) -> str:
    return "\n".join([f"| {head} |", "|---" * (head.count("|") + 1) + "|", *(f"| {row} |" for row in rows)])


def _levels(nominal: Any) -> list[str]:
    """Rows of the levels."""
    known = [(level, _widths(tolerances_of(nominal, level)), task_of(nominal, level).wear) for level in LEVELS]
    return [f"`{level}` | {widths} | {wear:.0%}" for level, widths, wear in known]


def _widths(widths: Any) -> str:
    return ", ".join(f"`{field}` +-{100 * width:g} %" for field, width in widths.items()) or "none"


def _model(env: Any) -> str:
    """Rung of the model that controllers may use, or how it differs from the nominal machine."""
    model, nominal = env.model, env.nominal
    if model.rung is not None:
        return f'"{model.rung}"'
    values = {name: getattr(model, name) for name in parameters_of(model)}
    return ", ".join(f"`{name}={value!r}`" for name, value in values.items() if value != getattr(nominal, name))


def _observations(environments: list[Any]) -> list[str]:
    spaces = [env.observation_space for env in environments]
    return [
        " | ".join([f"{k} | `{name}`: {meaning}", *(f"{space.low[k]:g} to {space.high[k]:g}" for space in spaces)])
        for k, (name, meaning) in enumerate(MEANINGS.items())
    ]


def _added(tasks: list[Any]) -> list[str]:
    """Rows of the entries that keywords add."""
    return [
        " | ".join([f'`{keyword}="{value}"` | `{entry.name}`: {entry.meaning}', *map("{:g} to {:g}".format, *bounds)])
        for keyword, (value, entry) in keywords_of(Task).items()
        for bounds in [zip(*map(entry.bounds, tasks), strict=True)]
    ]


def _arguments(tasks: list[Any]) -> list[str]:
    """Rows of the keywords; what all tasks have alike stands in the first column alone."""
    rows, added = [], keywords_of(Task)
    for name, about in sorted(parameters_of(Task).items(), key=lambda item: item[0] in added):
        values = [getattr(task, name) for task in tasks]
        shown = [f"`{value}`" if isinstance(value, str) else f"`{value:g}`" for value in values]
        unit = f" [{about.unit}]" if about.unit != "-" else ""
        columns = shown if len(set(shown)) > 1 else [shown[0], *[""] * (len(shown) - 1)]
        rows.append(" | ".join([f"`{name}`", *columns, about.source + unit]))
    return rows


def write_pages(folder: Path) -> None:
    """Write all pages into the folder of the documentation."""
    for file, text in pages():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
