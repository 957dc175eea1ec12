"""The command ``explore``: a machine's response in the browser, following its sliders."""

from typing import Any

import click

from chaosgym.cli.machine_options import machine_command


@machine_command(required=False)
@click.option("--port", type=click.IntRange(0, 65535), default=5006, show_default=True, help="0: any that is free.")
@click.option("--browser/--no-browser", default=True, show_default=True, help="Open the page in the usual browser.")
def explore(machine: Any, port: int, browser: bool, as_json: bool) -> None:
    """Drag sliders and watch motion, forces, verdict and classifier of a machine; Ctrl-C ends (extra [explore])."""
    import errno
    import json

    from chaosgym.errors import ChaosgymError
    from chaosgym.machines import ImpactBeam

    try:
        from chaosgym.explore.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "bokeh":
            raise
        raise ChaosgymError("explore needs bokeh: pip install '.[explore]' in a clone of chaosgym") from None

    def ready(address: str) -> None:
        click.echo(json.dumps({"address": address}) if as_json else f"{address}   (Ctrl-C ends)")
        if browser:
            click.launch(address)

    try:
        serve(machine or ImpactBeam(), port, ready)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        raise click.UsageError(f"--port {port} is taken; choose another one, or 0 for any that is free") from error
