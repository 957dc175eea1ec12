"""The commands ``chaosgym dataset ...``: what is in a dataset, and how far it may be trusted."""

import json
from pathlib import Path
from typing import Any

import click

from chaosgym.cli.output import emit

FOLDER = click.argument("folder", type=click.Path(exists=True, file_okay=False))
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


@click.group()
def dataset() -> None:
    """Describe a folder that `chaosgym sweep` made."""


@dataset.command("info")
@FOLDER
@AS_JSON
def info(folder: str, as_json: bool) -> None:
    """Print rows, classes, settings, label definitions, faults and provenance."""
    from chaosgym.sweeps.info import dataset_info

    found = dataset_info(folder)
    emit(found, as_json, lambda: _lines(folder, found))


def _lines(folder: str, found: dict[str, Any]) -> list[str]:
    rows, settings = found["rows"], found["settings"]
    state = "complete" if found["complete"] else "unfinished: run its `chaosgym sweep` command again"
    plan = ", ".join(
        f"{name} {settings[name]}" for name in ("sampling", "size", "seed", "budget", "signals", "full_types")
    )
    lines = [
        f"{folder}: {found['machine']}, {rows['finished']} of {rows['planned']} points, {state}",
        f"  settings: {plan}, version {settings['version']}",
    ]
    if not found["complete"]:
        return lines
    for name, counts in found["classes"].items():
        if not name.endswith("_by_split"):
            lines.append(f"  {name:20s}" + (", ".join(f"{label} {count}" for label, count in counts.items()) or "none"))
    lines.append(f"  {'faults':20s}" + ", ".join(f"{name} {count}" for name, count in found["faults"].items()))
    if found["types"]:
        types = found["types"]
        lines.append(
            f"  types from neighbours and over the full window differ at {types['disagreement']:.1%} "
            f"of {types['points']} points"
        )
    lines.append("  columns:")
    lines += [f"    {name:20s}{meaning}" for name, meaning in found["definitions"].items()]
    return [*lines, *(f"  made by {', '.join(f'{k} {v}' for k, v in made.items())}" for made in found["provenance"])]


@dataset.command("card")
@FOLDER
@AS_JSON
def card(folder: str, as_json: bool) -> None:
    """Write CARD.md into the folder of a finished sweep."""
    from chaosgym.sweeps.card import write_card

    path = write_card(folder)
    emit({"wrote": str(path)}, as_json, lambda: [f"wrote {path}"])


@dataset.command("noise")
@FOLDER
@click.option("--points", type=click.IntRange(1, 10**6), default=300, show_default=True, help="Rows to diagnose again.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@AS_JSON
def noise(folder: str, points: int, seed: int, workers: int | None, as_json: bool) -> None:
    """Measure how often labels change with the initial state, twice the cycles and 0.1 % in the parameters."""
    from chaosgym.files import write_atomically
    from chaosgym.sweeps import read_sweep
    from chaosgym.sweeps.card import NOISE_FILE
    from chaosgym.sweeps.noise import label_noise

    found = label_noise(read_sweep(folder), points, seed=seed, workers=workers, progress=True)
    text = json.dumps(found, indent=2) + "\n"
    write_atomically(Path(folder) / NOISE_FILE, lambda temporary: temporary.write_text(text))
    emit(
        found,
        as_json,
        lambda: [
            f"{folder}: {found['points']} rows diagnosed again; nature differs / still periodic, peak moved by 10 %",
            *(
                f"  {name:36s}{change['nature']:6.1%} +- {change['half_interval']:.1%}  {change['largest_peak']:6.1%}"
                for name, change in found["changes"].items()
            ),
        ],
    )


@dataset.command("map")
@FOLDER
@click.option("--out", type=click.Path(dir_okay=False), required=True, help="Picture to write (.png, .svg, .pdf).")
@AS_JSON
def map_(folder: str, out: str, as_json: bool) -> None:
    """Draw natures and response types over speed and clearance, as thesis figures 3.9 and 4.15."""
    from chaosgym.plotting.dataset import sweep_map
    from chaosgym.plotting.picture_file import check_picture, save_picture
    from chaosgym.sweeps import read_sweep

    path = check_picture(Path(out))
    save_picture(sweep_map(read_sweep(folder)), path)
    emit({"wrote": out}, as_json, lambda: [f"wrote {out}"])
