"""What does a trained agent do on a machine? ``run-agent``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.output import emit

if TYPE_CHECKING:
    from chaosgym.control.policies.play import PlayedJob


@click.command("run-agent")
@click.argument("env")
@click.option(
    "--policy",
    type=click.Path(file_okay=False, path_type=Path),
    default=None,
    help="Folder with policy.json and weights.npz; default: the shipped policy of ENV.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the machine and the sensor.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default=None,
    help="Figure (.png) or animation (.gif, .mp4) of speed, forces and regime.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def run_agent(env: str, policy: Path | None, seed: int, out: Path | None, as_json: bool) -> None:
    """Let a trained agent run one job of ENV, such as chaosgym/ImpactBeam-v0, on a held-out machine if it has any."""
    from chaosgym.envs import ENVIRONMENTS

    if env not in ENVIRONMENTS:
        raise click.UsageError(f"ENV {env} is unknown; known: {', '.join(ENVIRONMENTS)}")
    if out is not None:
        from chaosgym.plotting.played_job import check_format

        check_format(out)
    import gymnasium as gym

    from chaosgym.control.policies import load_policy, shipped_policy
    from chaosgym.control.policies.play import play

    agent = load_policy(policy) if policy else shipped_policy(env)
    # a policy may know the machines that it was trained on
    keywords: dict[str, Any] = {"pool": "held-out"} if "pool" in gym.spec(env).kwargs else {}
    machine = gym.make(env, **keywords)
    agent.fits(machine)
    agent.reset()
    job = play(machine, agent, seed)
    if out is not None:
        from chaosgym.plotting.played_job import save_job

        save_job(job, out)
    result = {**job.as_dict(), "out": str(out) if out else None}
    emit(result, as_json, lambda: _lines(job, out))


def _lines(job: "PlayedJob", out: Path | None) -> list[str]:
    told = job.as_dict()
    lines = [f"{'step':>5s} {'speed [' + job.unit + ']':>12s} {'largest peak [N]':>17s} {'damage':>7s}  regime"]
    for step in range(0, len(job.speed), 10):
        speed, peak, damage = job.speed[step], job.peak_force[step].max(), job.damage[step]
        regime = "Type III" if job.type_iii[step] else "calm"
        lines.append(f"{step + 1:5d} {speed:12.2f} {peak:17.1f} {damage:7.3f}  {regime}")
    lines.append(
        f"{told['status'].replace('_', ' ')}: return {told['return']:.3f}, Type III in {told['type_iii_share']:.1%} of "
        f"the steps, cost in {told['cost_share']:.1%}, damage {told['damage']:.3f}"
    )
    return [*lines, *([f"written to {out}"] if out else [])]
