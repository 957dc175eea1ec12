"""What does each command print? A page a command: examples with their real output, and its options.

python -m benchmarks.documentation.commands docs/commands [NAME ...]

With --options in place of names no example runs: only options and summaries become those of today.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import click

from chaosgym.cli import COMMANDS, app
from chaosgym.cli.options import KEYS, recording_options
from chaosgym.files import write_atomically
from chaosgym.machines import MACHINES

ROOT = Path(__file__).parents[2]

EXAMPLES: dict[str, list[dict[str, Any]]] = tomllib.loads(Path(__file__).with_name("examples.toml").read_text("utf-8"))
"""What each page shows, by the name of the command."""

LONGEST = 40
"""Lines of an output that a page shows."""

COMMON = """  --json                  Print one JSON object.
  --plot [FILE]           Draw a picture (.png, .svg or .pdf); without FILE into a new file of the
                          current folder.
  --workers INTEGER       Threads; default: all processors."""
"""Options of several commands, which the list of commands explains."""

OF_RECORDING = {
    name for option in click.command()(recording_options()(lambda **_: None)).params for name in option.opts
}

SHARED = {
    "show": ("of the machine", {"--set", "--fidelity"}),
    "judge": ("of a recording", OF_RECORDING),
    "index": ("", {"--json", "--plot", "--workers"}),
}
"""Options that several commands have: the page that lists them, what they are if many, and their names."""

PICTURES = (".png", ".gif", ".webp")


def summary(name: str) -> str:
    """Return what a command does, in its own words."""
    command = _command(name)
    return " ".join((command.help or "").split("\n\n")[0].split())


def options(name: str) -> str:
    """Return the help of a command and of those below it, as a terminal of 100 columns shows it."""
    command = _command(name)
    texts = [_help(command, f"chaosgym {name}")]
    texts += [_options_of(command, machine) for machine in sorted(MACHINES)] if name == "show" else []
    texts += [_keys()] if name == "judge" else []
    if isinstance(command, click.Group):
        texts += [_help(below, f"chaosgym {name} {inner}") for inner, below in sorted(command.commands.items())]
    return "\n\n".join(texts)


def _keys() -> str:
    """What ``--read`` takes, as a list of definitions."""
    formatter = click.HelpFormatter(width=100)
    with formatter.section("Keys of --read"):
        formatter.write_dl([(f"{key}={one.example}", one.help) for key, one in KEYS.items()])
    return "\n".join(line.rstrip() for line in formatter.getvalue().strip().splitlines())


def _options_of(command: click.Command, machine: str) -> str:
    """The options that a machine adds to a command, as its help shows them."""
    with command.make_context(f"chaosgym {command.name}", [machine], resilient_parsing=True) as context:
        records = [parameter.get_help_record(context) for parameter in command.get_params(context)]
    mark = f"[{machine}]"
    formatter = click.HelpFormatter(width=100)
    with formatter.section(f"Options of {machine}"):
        formatter.write_dl([(name, "") for name, text in filter(None, records) if text.startswith(mark)])
    return "\n".join(line.rstrip() for line in formatter.getvalue().strip().splitlines())


def index() -> str:
    """Return the page that lists all commands."""
    rows = [f"| [chaosgym {name}]({name}.md) | {summary(name)} |" for name in COMMANDS]
    return "\n".join(
        [
            "# Commands",
            "",
            "A command prints lines for people, or one JSON object with `--json`. Progress goes to standard error.",
            "What simulates for more than two seconds says there beforehand how much processor time it may take:",
            "`sweep: up to about 40 s of processor time`.",
            "[answers.schema.json](../answers.schema.json) is the JSON schema of these objects, one for each command.",
            "",
            "Exit codes: 0 done; 1 a computation failed or a disk was full, the same command may go on from there; 2",
            "wrong usage, one line says what is allowed; 130 stopped by Ctrl-C; 141 nobody reads the output.",
            "",
            "| command | what it does |",
            "|---|---|",
            *rows,
            "",
            "## Options",
            "",
            "Of several commands, whose pages name them:",
            "",
            f"```text\n{COMMON}\n```",
            "",
            "A machine has options of its own, see [show](show.md#options) and `chaosgym COMMAND MACHINE --help`.",
            "",
        ]
    )


def page(name: str, outputs: list[str]) -> str:
    """Return the page of a command, given what its examples printed."""
    parts = [f"# chaosgym {name}", summary(name)]
    for example, output in zip(EXAMPLES.get(name, []), outputs, strict=True):
        heading, _, more = example["what"].rstrip(".").partition(". ")
        parts += [f"## {heading}", *([f"{more}."] if more else []), f"```console\n$ {example['run']}\n{output}```"]
        parts += [f"![{heading}]({example['picture']})"] if "picture" in example else []
        parts += [f"![{file}]({name}-{file})" for file in _pictures(example)]
    return "\n\n".join([*parts, _last_part(name)])


def renewed(name: str, text: str) -> str:
    """Return a page with its outputs as they stand, and what the command says of itself today."""
    _, *examples, _ = text.split("\n\n## ")
    return "\n\n".join([f"# chaosgym {name}", summary(name), *(f"## {part}" for part in examples), _last_part(name)])


def outputs_of(name: str, folder: Path, chosen: Collection[int] | None = None) -> list[str]:
    """Return what the examples of a command, or some of them by number, print when they run in an empty folder."""
    (folder / "docs").mkdir()
    for source in ("docs/data", "docs/machines", "datasets"):
        (folder / source).symlink_to(ROOT / source)
    found = []
    for number, example in enumerate(EXAMPLES.get(name, [])):
        if chosen is not None and number not in chosen:
            continue
        if "before" in example:
            _run(example["before"], folder)
        found.append("" if "picture" in example else _run(example["run"], folder))
    return found


def write_page(name: str, folder: Path) -> None:
    """Run the examples of a command, and write its page and its pictures."""
    with tempfile.TemporaryDirectory() as place:
        outputs = outputs_of(name, Path(place))
        for example in EXAMPLES.get(name, []):
            for picture in _pictures(example):
                shutil.copyfile(Path(place) / picture, folder / f"{name}-{picture}")
    _write(folder / f"{name}.md", page(name, outputs))


def _run(line: str, folder: Path) -> str:
    """Return what a command line prints on standard output, cut where it is long."""
    python = f'chaosgym() {{ "{sys.executable}" -m chaosgym "$@"; }}; '
    environment = os.environ | {"COLUMNS": "100", "MPLBACKEND": "Agg"}
    command = ["bash", "-o", "pipefail", "-c", python + line]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{line}\n{done.stderr}")
    told = done.stdout.replace(str(Path.home()), "~").replace(platform.platform(), platform.system())
    lines = told.splitlines(keepends=True)
    return "".join([*lines[:LONGEST], "...\n"] if len(lines) > LONGEST else lines)


def _last_part(name: str) -> str:
    text, notes = options(name), []
    text = re.sub(r"^(Usage: .*\n(?: {9,}.*\n)*)\n(?:  \S.*\n)+", r"\1", text, count=1)  # the summary heads the page
    text = re.sub(r"\n  --help  +Show this message and exit\.", "", text).replace("Options:\n\n", "") + "\n"
    for home, (whose, names) in SHARED.items():
        listed = rf"^  (?:{'|'.join(sorted(names))}) .*\n(?:  {{9,}}.*\n)*"
        short = text if name == home else re.sub(listed, "", text, flags=re.MULTILINE)
        if short != text:
            left_out = sorted(key for key in names if re.search(rf"^  {key} ", text, re.MULTILINE))
            told = f"those {whose}" if whose else ", ".join(f"`{key}`" for key in left_out)
            notes.append(f"[{told}]({home}.md#options)")
        text = short
    text = re.sub(r"\n\nOptions:\n(?=\n|\Z)", "\n", text)  # where all of them are told elsewhere
    note = f"Besides {', '.join(notes)}:\n\n" if notes else ""
    return f"## Options\n\n{note}```text\n{text}```\n"


def _pictures(example: dict[str, Any]) -> list[str]:
    return [word for word in example["run"].split() if word.endswith(PICTURES)]


def _command(name: str) -> click.Command:
    command = app.get_command(click.Context(app), name)
    assert command is not None, name
    return command


def _help(command: click.Command, called: str) -> str:
    with click.Context(command, info_name=called, terminal_width=100, max_content_width=100) as context:
        text = command.get_help(context)
    return "\n".join(line.rstrip() for line in text.splitlines())


def _write(path: Path, text: str) -> None:
    write_atomically(path, lambda unfinished: unfinished.write_text(text, encoding="utf-8"))


def main(folder: Path, names: list[str]) -> None:
    """Write the list of commands and the pages of some, or of all."""
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / "index.md", index())
    for name in COMMANDS if names == ["--options"] else names or COMMANDS:
        place = folder / f"{name}.md"
        if names == ["--options"] and place.is_file():
            _write(place, renewed(name, place.read_text(encoding="utf-8")))
        else:
            print(name, file=sys.stderr, flush=True)
            write_page(name, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
