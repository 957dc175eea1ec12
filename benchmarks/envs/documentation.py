"""What does each environment's page say? What its task adds, and the docstring of its machine's class.

python -m benchmarks.envs.documentation docs
"""

import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import gymnasium as gym

from chaosgym.envs import ENVIRONMENTS

TASKS = {
    "": "The nominal machine.",
    "Tolerance": "A machine drawn within manufacturing tolerances for each job. The agent is not told which one.",
    "Wear": "A machine drawn within tolerances, whose clearance grows with the damage: c0 (1 + damage), updated once a "
    "step. The agent sees the damage.",
}
"""What each task adds, by the end of the id's name."""


def task_of(name: str) -> str:
    """Return the key of ``TASKS`` for an id."""
    return next((task for task in TASKS if task and f"{task}-" in name), "")


def pages() -> Iterator[tuple[str, str]]:
    """Names of the files, and the pages, in the format of Gymnasium's own (Markdown)."""
    rows = []
    for name in ENVIRONMENTS:
        task, file = task_of(name), f"environments/{name.removeprefix('chaosgym/')}.md"
        nominal = name.replace(f"{task}-v", "-v")
        text = inspect.getdoc(type(gym.make(name).unwrapped)) or ""
        text = text.replace(f'("{nominal}"', f'("{name}"')
        for parameter, default in gym.spec(name).kwargs.items():
            row = re.compile(rf"(\| `{parameter}` +\| [^|]+ \| )`\w+`")
            text = row.sub(rf"\g<1>`{default}`", text)
        yield file, f"# {name}\n\n{TASKS[task]}\n\n{text}\n"
        rows.append(f"| [{name}]({file}) | {TASKS[task]} |")
    table = "\n".join(["| id | task |", "|---|---|", *rows])
    yield (
        "environments.md",
        f"# Environments\n\n{table}\n\nThese pages are written by `python -m benchmarks.envs.documentation docs`.\n",
    )


def write_pages(folder: Path) -> None:
    """Write all pages into the folder of the documentation."""
    for file, page in pages():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
