"""The command line: each command parses, calls one library function, and prints or saves.

Tables for people go to standard output, ``--json`` prints one JSON object there instead; progress and logs go to
standard error. Exit codes: 0 done, 1 a computation failed, 2 wrong usage.
"""

import sys

import click

from chaosgym.cli.classify import classify
from chaosgym.cli.dataset import dataset
from chaosgym.cli.demo import demo
from chaosgym.cli.design import design
from chaosgym.cli.diagnose import diagnose
from chaosgym.cli.fidelity import stability, tradeoff
from chaosgym.cli.info import info
from chaosgym.cli.regimes import regimes
from chaosgym.cli.run_agent import run_agent
from chaosgym.cli.simulate import show, simulate
from chaosgym.cli.sweep import sweep
from chaosgym.cli.train_classifier import train_classifier
from chaosgym.errors import ChaosgymError, SimulationError, UnfinishedError
from chaosgym.version import __version__


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="chaosgym")
def app() -> None:
    """Machines with clearance that rattle: simulate, diagnose, sweep and classify them."""


for command in (
    simulate,
    show,
    diagnose,
    classify,
    sweep,
    dataset,
    train_classifier,
    demo,
    design,
    tradeoff,
    stability,
    regimes,
    run_agent,
    info,
):
    app.add_command(command)


def main() -> None:
    """Entry point of ``chaosgym``."""
    run_command(app)


def run_command(command: click.Command) -> None:
    """Run a command line: one clear line instead of a traceback for every error that chaosgym raises on purpose."""
    try:
        command(standalone_mode=False)
    except click.exceptions.Abort:
        click.echo("Aborted.", err=True)
        sys.exit(130)
    except click.ClickException as error:
        click.echo(f"Error: {error.format_message()}", err=True)
        sys.exit(error.exit_code)
    except (ChaosgymError, OSError) as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(1 if isinstance(error, SimulationError | UnfinishedError) else 2)
