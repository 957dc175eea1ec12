"""The command line: each command parses, calls one library function, and prints or saves.

Tables for people go to standard output, ``--json`` prints one JSON object there instead; progress and logs go to
standard error. Exit codes: 0 done, 1 a computation failed, 2 wrong usage, 130 ended by Ctrl-C, 141 nobody reads the
output. Nothing is coloured, so NO_COLOR holds.
"""

import atexit
import errno
import gc
import os
import sys
import warnings
from importlib import import_module
from typing import NoReturn

import click

from chaosgym.cli.interrupt import ABORTED, heard_at_once
from chaosgym.errors import ChaosgymError, SimulationError, UnfinishedError, nearest_or
from chaosgym.version import __version__

COMMANDS = {
    "simulate": "simulate:simulate",
    "show": "simulate:show",
    "new-machine": "simulate:new_machine",
    "export": "export:export",
    "diagnose": "diagnose:diagnose",
    "judge": "judge:judge",
    "judge-sweep": "judge:judge_sweep",
    "run-up": "judge:run_up",
    "monitor": "monitor:monitor",
    "fit": "fit:fit",
    "overlay": "fit:overlay",
    "branch": "branch:branch",
    "explore": "demo:explore",
    "classify": "classify:classify",
    "sweep": "sweep:sweep",
    "dataset": "sweep:dataset",
    "train-classifier": "classify:train_classifier",
    "design": "design:design",
    "tradeoff": "fidelity:tradeoff",
    "compare": "agents:compare",
    "run-agent": "agents:run_agent",
    "demo": "demo:demo",
    "info": "info:info",
}
"""Module in this folder and function of every command."""

ALIKE = 0.7
"""How alike an option must be to the one that was written, from 0 to 1, to be the one that was meant."""

RARELY = 50_000
"""New objects after which garbage is looked for: imports make many that stay, and a search each 700 takes a tenth."""

BEYOND_THE_USER = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.EFBIG)
"""Errors of a disk that no other way of asking would have avoided."""


class Group(click.Group):
    """A group that says which command was probably meant."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that is called, its name and its words."""
        names = self.list_commands(ctx)
        if args[0] not in names and not args[0].startswith("-"):
            hint = nearest_or(f"allowed: {', '.join(names)}", args[0], names)
            raise click.UsageError(f"there is no command {args[0]}; {hint}", ctx)
        return super().resolve_command(ctx, args)


class Commands(Group):
    """Commands that are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; None if there is none of that name."""
        if cmd_name not in COMMANDS:
            return None
        module, _, function = COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(import_module(f"chaosgym.cli.{module}"), function)
        return command


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="chaosgym")
def app() -> None:
    """Machines with clearance that rattle: simulate, diagnose, sweep and classify them; judge recordings."""


def main() -> None:
    """Entry point of ``chaosgym``."""
    run_command(app)


def run_command(command: click.Command) -> None:
    """Run a command line: one clear line instead of a traceback for every error that chaosgym raises on purpose."""
    _use_one_blas_thread()
    warnings.formatwarning = lambda message, *_, **__: f"note: {message}\n"  # without a line of code
    gc.set_threshold(RARELY, 50, 100)
    atexit.register(gc.freeze)  # a last search for garbage takes as long as a short question
    try:
        with heard_at_once():
            command(standalone_mode=False)
    except click.exceptions.Abort as stop:
        if isinstance(stop.__cause__, EOFError):  # click takes the end of a damaged file for that of a person's input
            _end(f"a file ended too early: {stop.__cause__}", 1)
        click.echo("Aborted.", err=True)
        sys.exit(ABORTED)
    except click.NoSuchOption as error:
        _end(_unknown_option(error), error.exit_code)
    except click.ClickException as error:
        _end(error.format_message(), error.exit_code)
    except (SimulationError, UnfinishedError) as error:
        _end(error, 1)
    except ChaosgymError as error:
        _end(error, 2)
    except MemoryError as error:
        _end(f"there is not enough memory{': ' if str(error) else ''}{error}", 1)
    except OSError as error:
        _drop_unwritten_output()
        _end(error, 1 if error.errno in BEYOND_THE_USER else 2)


def _unknown_option(error: click.NoSuchOption) -> str:
    """What to say of an option that a command has not: the key of ``--read``, the one that was meant, or all."""
    from chaosgym.cli.options import KEYS

    if error.ctx is None:
        return error.format_message()
    known = [name for one in error.ctx.command.get_params(error.ctx) for name in one.opts if name.startswith("--")]
    key = error.option_name.removeprefix("--")
    if key in KEYS and "--read" in known:
        hint = f"state --read {key}=VALUE"
    else:
        hint = nearest_or(f"allowed: {', '.join(known)}", error.option_name, known, alike=ALIKE)
    return f"{error.ctx.command_path} has no option {error.option_name}; {hint}"


def _use_one_blas_thread() -> None:
    """Matrices are small here: threads that wait for each other cost a hundredfold beside other busy programs."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1, user_api="blas")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # scipy's, which is loaded later


def _drop_unwritten_output() -> None:
    """Drop what a full disk did not take: Python would try again as it ends, and say so in lines of its own."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _end(message: object, code: int) -> NoReturn:
    click.echo(f"Error: {message}", err=True)
    sys.exit(code)
