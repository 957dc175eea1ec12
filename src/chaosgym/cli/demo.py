"""The commands ``demo``, a tour of a minute, and ``explore``, sliders in the browser."""

from typing import Any

import click

from chaosgym.cli.machine_options import machine_command, model_over
from chaosgym.cli.options import IntRange
from chaosgym.cli.output import AS_JSON, DIAGNOSED, announce, emit


@click.command()
@click.option("--out", type=click.Path(file_okay=False), default="chaosgym-demo", show_default=True, help="New folder.")
@click.option("--seed", type=IntRange(0), default=0, show_default=True)
@click.option("--train", is_flag=True, help="Train the agent, for some minutes, rather than take the shipped one.")
@AS_JSON
def demo(out: str, seed: int, train: bool, as_json: bool) -> None:
    """Simulate, label, learn, and compare an agent with plain rules; a picture a step (needs the extra [learn])."""
    from chaosgym.demo import demo_table, most_cycles, run_demo
    from chaosgym.machines import ImpactBeam

    announce("demo", ImpactBeam(), DIAGNOSED * most_cycles(train))
    result = run_demo(out, seed, train, say=lambda line: click.echo(line, err=True))
    emit(result, as_json, lambda: demo_table(result))


@machine_command(required=False, chooses="range")
@click.option("--port", type=IntRange(0, 65535), default=5006, show_default=True, help="0: any that is free.")
@click.option("--browser/--no-browser", default=True, show_default=True, help="Open the page in the usual browser.")
def explore(machine: Any, port: int, browser: bool, as_json: bool) -> None:
    """Drag sliders and watch motion, forces, verdict and calm speeds of a machine; Ctrl-C ends (extra [explore])."""
    import errno
    import json

    from chaosgym.errors import ChaosgymError
    from chaosgym.machines import ImpactBeam

    machine = machine or ImpactBeam()
    machine = model_over(machine, _corners(machine))
    try:
        from chaosgym.explore.page import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "bokeh":
            raise
        raise ChaosgymError("explore needs bokeh: pip install '.[explore]' in a clone of chaosgym") from None

    def ready(address: str) -> None:
        click.echo(json.dumps({"address": address}) if as_json else f"{address}   (Ctrl-C ends)")
        if browser:
            click.launch(address)

    try:
        serve(machine, port, ready)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        raise click.UsageError(f"--port {port} is taken; choose another one, or 0 for any that is free") from error


def _corners(machine: Any) -> list[Any]:
    """The machine where it is, and at the ends of its usual speeds and clearances: the page keeps one model."""
    speeds, gaps = (machine.usual_ranges.get(name, ()) for name in (machine.speed_field, machine.clearance_field))
    return [machine, *(machine.at(speed, gap) for speed in speeds for gap in gaps)]
