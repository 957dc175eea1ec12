"""What does the page of each machine's environments say? One text, filled in from the task: spaces, numbers, levels.

python -m benchmarks.envs.documentation docs
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym

from chaosgym.envs import ENVIRONMENTS
from chaosgym.envs.drive import MOVES
from chaosgym.envs.judge import ExponentJudge
from chaosgym.envs.observation import MEANINGS
from chaosgym.envs.setups import LEVELS, task_of, tolerances_of
from chaosgym.machines.parameters import parameters_of

KINDS = {
    "": "The nominal machine.",
    "Tolerance": "A machine drawn within manufacturing tolerances for each job. The agent is not told which one.",
    "Wear": "A machine drawn within tolerances, whose clearance grows by 10 % in the job, a little at every step.",
}
"""What each task adds, by the end of the id's name."""

ANY_MACHINE = "A machine of a broad family for each job, in shares of its own range of speed and of its rated force."
"""What the id says of which the page is written by hand."""

MACHINES = {
    "impact-beam": "A steel beam on a flexure pivot is shaken between pivot and tip, and its tip rattles between two "
    "force sensors. It is the Impact Beam System of P. Gu's thesis (MIT, 1994, chapter 3), shaken twice as hard as "
    "there. With the thesis' force, chaos fills 2 to 6 Hz in a row, which a trim of 2 Hz does not leave. Here it comes "
    "in bands of 1 to 2 Hz with calm speeds between. Where they lie depends on the clearance, which the mean peak "
    "force tells.",
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

TEXT = (Path(__file__).parent / "page.md").read_text(encoding="utf-8")
"""The page, with places for what differs."""


def pages() -> Iterator[tuple[str, str]]:
    """Names of the files, and the pages, in the format of Gymnasium's own (Markdown)."""
    rows = []
    for machine, names in _by_machine().items():
        file = f"environments/{machine}.md"
        yield file, page(names)
        rows += [f"| [`{name}`]({file}) | {KINDS[kind_of(name)]} |" for name in names]
    rows.append(f"| [`chaosgym/AnyMachine-v0`](environments/AnyMachine.md) | {ANY_MACHINE} |")
    table = "\n".join(["| id | task |", "|---|---|", *rows])
    yield (
        "environments.md",
        f"# Environments\n\n{table}\n\nThese pages are written by `python -m benchmarks.envs.documentation docs`.\n",
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


def page(names: list[str]) -> str:
    """Text of the page of one machine's ids, of which the first is the nominal machine's."""
    name = names[0]
    env: Any = gym.make(name).unwrapped
    task, nominal = env.task, env.nominal
    unit = parameters_of(nominal)[nominal.speed_field].unit
    moves = [f"{task.trim_step * move:+g} {unit} of trim" if move else "hold" for move in MOVES]
    noise = []
    if task.speed_ripple:
        noise.append(f"The speed ripples by {task.speed_ripple:.1%} (standard deviation) from cycle to cycle.")
    if task.kick:
        noise.append(f"Velocities are kicked by {task.kick:g} of their range (standard deviation) once a cycle.")
    return TEXT.format(
        name=name,
        title=name.removeprefix("chaosgym/").split("-")[0],
        ids=_table(
            "id | level |", [f"`{one}` | `{gym.spec(one).kwargs['level']}` | {KINDS[kind_of(one)]}" for one in names]
        ),
        machine=MACHINES[nominal.name],
        short=nominal.name,
        unit=unit,
        shortest=task.shortest_hold,
        longest=task.longest_hold,
        actions=_table("Num | Action", [f"{k} | {move}" for k, move in enumerate([*moves, "back to the demand"])]),
        low=task.lowest_speed,
        high=task.highest_speed,
        slew=task.slew_limit,
        grid=f", on a grid of {task.speed_grid:g} {unit}" if task.speed_grid else "",
        trim=task.largest_trim,
        coarse=2 * task.trim_step,
        size=len(MEANINGS),
        sensor=task.sensor_error,
        bouncing=task.bouncing_error,
        missed=task.missed_impacts,
        observations=_table("Num | Observation | Min | Max", _observations(env)),
        judge=JUDGES[isinstance(env._job.judge, ExponentJudge)],
        rating=task.load_rating,
        life=task.life_share,
        start=task.start_below,
        run_in=task.run_in_cycles,
        steps=task.steps,
        cycles=task.cycles_per_step,
        levels=_table("level | tolerances | growth of the clearance in a job", _levels(nominal)),
        disturbance=" ".join(noise),
        rung=nominal.rung or "none",
        model=_model(env),
        arguments="\n".join(_arguments(task)),
        **{
            name: getattr(task, name)
            for name in ("deviation_weight", "type_iii_weight", "damage_weight", "time_weight", "failure_weight")
        },
    )


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


def _observations(env: Any) -> list[str]:
    bounds = zip(env.observation_space.low, env.observation_space.high, strict=True)
    named = zip(MEANINGS.items(), bounds, strict=True)
    return [f"{k} | `{name}`: {meaning} | {low:g} | {high:g}" for k, ((name, meaning), (low, high)) in enumerate(named)]


def _arguments(task: Any) -> Iterator[str]:
    for name, about in parameters_of(task).items():
        value = getattr(task, name)
        yield f"| `{name}` | `{value if isinstance(value, str) else f'{value:g}'}` | {about.unit} | {about.source} |"


def write_pages(folder: Path) -> None:
    """Write all pages into the folder of the documentation."""
    for file, text in pages():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
