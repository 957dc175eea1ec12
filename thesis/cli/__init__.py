"""Command line of ``python -m thesis``."""

import click

from chaosgym.cli import run_command
from thesis.cli.calibrate import calibrate
from thesis.cli.exclusions import exclusions
from thesis.cli.figures import figures
from thesis.cli.firmness import firmness
from thesis.cli.numerics import numerics
from thesis.cli.scorecard import scorecard


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
def app() -> None:
    """The statements and figures of the thesis, computed on the machines of chaosgym."""


for command in (scorecard, figures, calibrate, firmness, exclusions, numerics):
    app.add_command(command)


def main() -> None:
    """Entry point."""
    run_command(app)
