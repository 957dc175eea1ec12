"""What do the tables say that rewards rest on, and can they be trusted? ``regimes``."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.output import emit
from chaosgym.envs import ENVIRONMENTS

if TYPE_CHECKING:
    from chaosgym.envs.audit import Score

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


@regimes.command()
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--samples", type=click.IntRange(1), default=200, show_default=True, help="Steps that are looked at.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def check(env: str, samples: int, seed: int, as_json: bool) -> None:
    """Compare the table with a full diagnosis in steps that random jobs on held-out machines went through."""
    from chaosgym.envs.regime_check import check_regimes

    found = check_regimes(env, samples, seed, progress=True)
    emit(
        found.as_dict(),
        as_json,
        lambda: [
            f"{env}: {found.as_dict()['agreement']:.1%} of {found.samples} steps agree",
            f"  counted as Type III and not periodic {found.irregular}, though periodic {found.blamed}",
            f"  not counted and periodic {found.periodic}, though not periodic {found.missed}",
        ],
    )


@regimes.command()
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def audit(env: str, as_json: bool) -> None:
    """Play every loophole that one could think of for a job on the nominal machine."""
    from chaosgym.envs.audit import audit as play

    scores = play(env)
    emit({"env": env, "schedules": [score.as_dict() for score in scores]}, as_json, lambda: _audit_lines(scores))


def _audit_lines(scores: list["Score"]) -> list[str]:
    """The best and the worst schedule of each kind."""
    lines = [f"{'schedule':16s} {'speeds':>15s} {'return':>8s} {'Type III':>8s} {'force':>6s} {'damage':>6s}  end"]
    for kind in dict.fromkeys(score.plan.kind for score in scores):
        ranked = sorted((score for score in scores if score.plan.kind == kind), key=lambda score: -score.total)
        for score in ranked[:3] + ranked[3:][-1:]:
            speeds = " to ".join(f"{speed:g}" for speed in score.plan.speeds)
            lines.append(
                f"{kind:16s} {speeds:>15s} {score.total:8.3f} {score.type_iii:8.1%} {score.force:6.1%} "
                f"{score.damage:6.2f}  {score.status}"
            )
    return [*lines, f"largest reward of a step: {max(score.best_step for score in scores):.2g}"]
