"""The command ``calibrate``: which unprinted parameters bring a machine closest to the thesis."""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli.output import emit


@click.command()
@click.argument("machine", type=click.Choice(["impact-beam", "slider-crank"]))
@click.option(
    "--budget",
    required=True,
    metavar="MINUTES|TRIALS",
    help="Of the search, as in 20min, or a number of trials in all; the thorough runs that judge it come on top.",
)
@click.option("--out", type=click.Path(file_okay=False), required=True, help="Folder; the same command again resumes.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def calibrate(machine: str, budget: str, out: str, seed: int, workers: int | None, as_json: bool) -> None:
    """Search the parameters that the thesis does not print (needs the extra [calibrate])."""
    from thesis.scorecard.calibrate import Budget
    from thesis.scorecard.calibrate import calibrate as search

    found = search(machine, Budget.parse(budget), Path(out), seed=seed, workers=workers, progress=True)
    result = found.as_dict()
    emit(result, as_json, lambda: _lines(result, out))


def _lines(result: dict[str, Any], out: str) -> list[str]:
    rates = result["hits_of"]
    lines = [
        f"{result['machine']}: objective {result['objective']:.4f} after {result['trials']} trials; "
        f"present constants {result['present_objective']:.4f}",
        *(
            f"  {which:8s} hits {rates[which]['calibration'][0]} of {rates[which]['calibration'][1]} statements that "
            f"the search saw, {rates[which]['held-out'][0]} of {rates[which]['held-out'][1]} held out"
            for which in ("best", "present")
        ),
        f"  {'parameter':30s} {'best':>12s} {'near-best candidates':>27s}  spread",
    ]
    for one in result["determination"]:
        best, near = one["best"], one["near_best"]
        spread = "" if one["spread"] is None else f"{one['spread']:.0%} of the range"
        shown = best if isinstance(best, str) else f"{best:.5g}"
        span = ", ".join(near) if one["spread"] is None else f"{near[0]:.5g} to {near[1]:.5g}"
        lines.append(f"  {one['name']:30s} {shown:>12s} {span:>27s}  {spread}")
    return [*lines, f"residuals and sensitivities: {out}/result.json"]
