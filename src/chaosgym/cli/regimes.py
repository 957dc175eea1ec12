"""What do the tables say that rewards rest on, and can they be trusted? ``regimes``."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from chaosgym.cli.output import emit
from chaosgym.envs import ENVIRONMENTS

_FOLDER = click.Path(file_okay=False, path_type=Path)


@click.group()
def regimes() -> None:
    """Regime tables of the environments' machines: make the pools, check them."""


@regimes.command()
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--spacing", type=click.FloatRange(1e-3), help="Of the speeds; that of the environment by default.")
@click.option("--machines", type=click.IntRange(1), help="The first of them, the nominal one included; all by default.")
@click.option("--out", type=_FOLDER, default=Path(), show_default=True, help="Folder of the file.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def make(env: str, spacing: float | None, machines: int | None, out: Path, as_json: bool) -> None:
    """Draw the pools of an environment and diagnose every machine at every speed (up to an hour; resumable)."""
    import gymnasium as gym

    from chaosgym.envs.pools import Pool, make_pools

    asked: Any = gym.make(env).unwrapped
    drive = replace(asked.drive, regime_spacing=spacing or asked.drive.regime_spacing)
    command = f"chaosgym regimes make {env}" + (f" --spacing {spacing:g}" if spacing else "")
    command += f" --machines {machines}" if machines else ""
    out.mkdir(parents=True, exist_ok=True)
    path, file = make_pools(Pool(asked.nominal, drive, asked.tolerances, wear=asked.pool.wears), out, command, machines)
    summary = {"file": str(path), **file.about}
    emit(summary, as_json, lambda: [f"{path}: {len(file.nature)} machines at {len(file.speeds)} speeds"])
