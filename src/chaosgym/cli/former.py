"""Former spellings of commands and options: they work for one version and say what to write instead.

Delete this file, its call in ``chaosgym.cli`` and its section in the list of commands with that version.
"""

import re
import shlex
from typing import NamedTuple

import click


class Spelling(NamedTuple):
    """A former command line and that of today; a word in capitals stands for itself in both."""

    former: str
    current: str


OPTIONS = (
    Spelling("--hz NUMBER", "--cycle 'NUMBER Hz'"),
    Spelling("--rpm NUMBER", "--cycle 'NUMBER rpm'"),
    Spelling("--period-s NUMBER", "--cycle 'NUMBER s'"),
)
"""Options of every command below. A number that has its unit keeps it."""

KEYED = {
    "sweep": ("--label", "full-types initial-states definition signals"),
    "judge": ("--read", "unit scale sheet tachometer pulses-per-revolution sensor-sigma"),
    "fit": ("--read", "unit scale sheet tachometer pulses-per-revolution sensor-sigma"),
    "overlay": ("--read", "unit scale sheet tachometer pulses-per-revolution sensor-sigma"),
    "classify": ("--read", "column unit scale sheet as rate-hz cycle tachometer pulses-per-revolution sensor-sigma"),
    "design": (
        "--read",
        "column unit scale sheet as rate-hz cycle tachometer pulses-per-revolution sensor-error sensor-sigma",
    ),
    "judge-sweep": ("--read", "unit scale sheet sensor-sigma"),
    "run-up": ("--read", "unit scale sheet sensor-sigma"),
    "monitor": ("--read", "unit scale sensor-sigma"),
}
"""Options that one of KEY=VALUE took the place of, by command."""

COMMANDS = (
    Spelling("diagnose --sweep FILE", "judge-sweep FILE"),
    Spelling("diagnose --series FILE --run-up", "run-up FILE"),
    Spelling("diagnose MACHINE --peaks FILE", "fit MACHINE FILE --as peaks"),
    Spelling("diagnose MACHINE --series FILE", "fit MACHINE FILE --as series"),
    Spelling("diagnose --peaks FILE", "judge FILE --as peaks"),
    Spelling("diagnose --series FILE", "judge FILE --as series"),
    Spelling("diagnose MACHINE --step-check", "tradeoff MACHINE --step-check"),
    Spelling("overlay MACHINE --peaks FILE", "overlay MACHINE FILE --as peaks"),
    Spelling("overlay MACHINE --series FILE", "overlay MACHINE FILE --as series"),
    Spelling("classify MACHINE --follow", "monitor"),
    Spelling("classify MACHINE --peaks FILE", "classify MACHINE FILE --read as=peaks"),
    Spelling("classify MACHINE --series FILE", "classify MACHINE FILE --read as=series"),
    Spelling("design --beside --peaks FILE", "design --beside FILE --read as=peaks"),
    Spelling("design --beside --series FILE", "design --beside FILE --read as=series"),
    Spelling("design BRIEF --peaks FILE", "design BRIEF --beside FILE --read as=peaks"),
    Spelling("design BRIEF --series FILE", "design BRIEF --beside FILE --read as=series"),
    Spelling("design --peaks FILE --out REPORT", "judge FILE --as peaks --report REPORT"),
    Spelling("design --series FILE --out REPORT", "judge FILE --as series --report REPORT"),
    Spelling("design --peaks FILE", "judge FILE --as peaks"),
    Spelling("design --series FILE", "judge FILE --as series"),
    Spelling("judge --out REPORT", "judge --report REPORT"),
    Spelling("sweep --random NUMBER --seed SEED", "sweep --sampling random:NUMBER:SEED"),
    Spelling("sweep --sobol NUMBER --seed SEED", "sweep --sampling sobol:NUMBER:SEED"),
    Spelling("sweep --crosses NUMBER --seed SEED", "sweep --sampling crosses:NUMBER:SEED"),
    Spelling("sweep --random NUMBER", "sweep --sampling random:NUMBER"),
    Spelling("sweep --sobol NUMBER", "sweep --sampling sobol:NUMBER"),
    Spelling("sweep --crosses NUMBER", "sweep --sampling crosses:NUMBER"),
    Spelling("sweep --grid", "sweep --sampling grid"),
    Spelling("sweep --seed SEED", "sweep"),
    Spelling("sweep --scheduler ADDRESS", "sweep --workers ADDRESS"),
    Spelling("sweep --routes", "sweep --label routes=yes"),
)
"""Commands, each that fits in this order; what they do not name stays as it is."""

PLACEHOLDER = re.compile("[A-Z]+")
"""Word of a spelling that stands for one of the command line."""

NAMED = {"MACHINE", "BRIEF"}
"""Words that stand for the machine, or the file, that a command line names."""


def rewritten(arguments: list[str]) -> list[str]:
    """A command line as it is written today; says so on standard error where it was written otherwise.

    Examples
    --------
    >>> from chaosgym.cli.former import rewritten
    >>> rewritten(["judge", "peaks.csv"])
    ['judge', 'peaks.csv']
    """
    current = arguments
    for row in COMMANDS:
        current = _command(row, current) if _fits(row, current) else current
    for row in OPTIONS if current != arguments else ():
        current = _option(row, current)
    option, keys = KEYED.get(current[0], ("", "")) if current else ("", "")
    for key in keys.split():
        value, rest = _without(f"--{key}", True, current)
        current = current if rest == current else [*rest, option, f"{key}={value}"]
    if current == arguments:
        return arguments
    click.echo(f"note: a former spelling, which the next version does not know; write: {_shown(current)}", err=True)
    return current


def _shown(arguments: list[str]) -> str:
    return f"chaosgym {shlex.join(arguments)}"


def _options(words: list[str]) -> dict[str, str | None]:
    """Options of a spelling with the word that stands for their value; None for a flag."""
    pairs = zip(words, [*words[1:], "--"], strict=True)
    return {word: None if value.startswith("--") else value for word, value in pairs if word.startswith("--")}


def _fits(row: Spelling, arguments: list[str]) -> bool:
    command, *words = row.former.split()
    stated = {argument.partition("=")[0] for argument in arguments}
    if arguments[:1] != [command] or not stated.issuperset(_options(words)):
        return False
    return NAMED.isdisjoint(words) or _named(arguments[1:]) is not None


def _named(arguments: list[str]) -> str | None:
    """The machine or the brief that a command line names."""
    from chaosgym.machines import FILE_ENDING, MACHINES

    return next((word for word in arguments if word in MACHINES.entry_points or word.endswith(FILE_ENDING)), None)


def _command(row: Spelling, arguments: list[str]) -> list[str]:
    """The arguments in the form of today."""
    former, rest, words = row.former.split(), arguments[1:], {}
    for placeholder in NAMED.intersection(former):
        name = _named(rest) or ""
        words[placeholder], rest = name, [argument for argument in rest if argument != name]
    for option, word in _options(former).items():
        value, rest = _without(option, word is not None, rest)
        words |= {} if word is None else {word: value}
    return [PLACEHOLDER.sub(lambda found: words.get(found[0], found[0]), word) for word in row.current.split()] + rest


def _without(option: str, valued: bool, arguments: list[str]) -> tuple[str, list[str]]:
    """Value of an option, the last one as for click, and the arguments without it."""
    value, rest, words = "", list[str](), iter(arguments)
    for word in words:
        if word == option:
            value = next(words, "") if valued else ""
        elif valued and word.startswith(f"{option}="):
            value = word.partition("=")[2]
        else:
            rest.append(word)
    return value, rest


def _option(row: Spelling, arguments: list[str]) -> list[str]:
    """The arguments with an option in the form of today."""
    option, _ = row.former.split()
    new, text = shlex.split(row.current)
    value, rest = _without(option, True, arguments)
    if rest == arguments:
        return arguments
    bare = value[-1:].isdigit() or value[-1:] == "."
    return [*rest, new, text.replace("NUMBER", value) if bare else value]
