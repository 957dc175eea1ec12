"""The command ``run-agent``: what a trained agent does on a machine."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from chaosgym.cli.output import emit, patience
from chaosgym.cli.plot_option import picture_path, plot_option

if TYPE_CHECKING:
    from chaosgym.control.rollout import Played


@click.command("run-agent")
@click.argument("env")
@click.option(
    "--policy",
    type=click.Path(file_okay=False, path_type=Path),
    default=None,
    help="Folder with policy.json and weights.npz; default: the shipped policy of ENV.",
)
@click.option("--machine", type=click.IntRange(0, 255), default=0, show_default=True, help="Of those kept for this.")
@plot_option("--out", formats="figure .png, .svg, .pdf or animation .gif, .mp4")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def run_agent(env: str, policy: Path | None, machine: int, plot: str | None, as_json: bool) -> None:
    """Let a trained agent run one job beside following the demand.

    ENV is an id such as chaosgym/ImpactBeamTolerance-v1, or the file of a machine.
    """
    from chaosgym.envs import environment

    environment(env)
    out = _picture(plot, env)
    from chaosgym.control.controllers import Follow
    from chaosgym.control.policies import load_policy, shipped_policy
    from chaosgym.control.rollout import play

    agent = load_policy(policy) if policy else shipped_policy(env)
    with patience("run-agent"):
        job, follow = play(agent, env, [machine]), play(Follow(), env, [machine])
    if out is not None:
        from chaosgym.plotting.played_job import save_job

        save_job({"agent": job, "follow the demand": follow}, out)
    result = {**job.as_dict(), "follow": follow.as_dict(), **({"plot": str(out)} if out else {})}
    emit(result, as_json, lambda: _lines(job, follow, out))


def _picture(plot: str | None, env: str) -> Path | None:
    """Path of the figure or animation, checked before a job is played."""
    if plot is None:
        return None
    from chaosgym.plotting.played_job import FORMATS, check_format

    out = picture_path(plot, f"run-agent-{env.rpartition('/')[2]}", FORMATS)
    if out is not None:
        check_format(out)
    return out


def _lines(job: "Played", follow: "Played", out: Path | None) -> list[str]:
    told = job.as_dict()
    lines = [f"{'step':>5s} {'demand':>8s} {'speed [' + job.unit + ']':>12s} {'mean peak [N]':>14s}  Type III"]
    for step in range(0, len(told["speed"]), 10):
        demand, speed, peak = told["demand"][step], told["speed"][step], told["mean_peak_force_N"][step]
        lines.append(f"{step + 1:5d} {demand:8.2f} {speed:12.2f} {peak:14.1f} {told['type_iii'][step]:9.0%}")
    for name, played in (("agent", told), ("following the demand", follow.as_dict())):
        lines.append(
            f"{name}: {played['status'].replace('_', ' ')}, return {played['return']:.2f}, Type III in "
            f"{played['type_iii_share']:.1%} of the cycles, {played['mean_deviation']:.2f} {job.unit} off the demand"
        )
    return [*lines, *([f"picture: {out}"] if out else [])]
