"""Options that messages name: whoever is told to state one has it."""

import ast
import re
from pathlib import Path

import click

import chaosgym
from chaosgym.cli import COMMANDS, app
from chaosgym.cli.options import KEYS

PACKAGE = Path(chaosgym.__file__).parent
OPTION = r"(?<![\w-])--[a-z][a-z-]+"
NAMED = re.compile(rf"(?:`chaosgym (?P<command>[a-z][\w-]*)[^`]*?)?(?P<option>{OPTION})")
OPTIONS = {
    name: {"--help", *(option for one in app.get_command(click.Context(app), name).params for option in one.opts)}
    for name in COMMANDS
}
RECORDINGS = [name for name, options in OPTIONS.items() if "--read" in options]
COMMANDS_OF = {
    "recordings/measured_sweep.py": ["judge-sweep"],
    "recordings/run_up.py": ["run-up"],
    "recordings/stream.py": ["monitor"],
    "recordings/swept_files.py": ["run-up"],
}
"""Commands that print what a module says, where not every command of recordings does."""

OF_SPEEDS = "--speed-column"
"""Asked for where several columns could be the speed, which judge-sweep alone looks for."""


def messages():
    """Texts of the package that name an option among other words: module, and text, with {} for what is filled in."""
    for path in sorted(PACKAGE.rglob("*.py")):
        source = path.read_text()
        for node in ast.walk(ast.parse(source)) if re.search(OPTION, source) else ():
            parts = node.values if isinstance(node, ast.JoinedStr) else [node]
            text = "".join(str(one.value) if isinstance(one, ast.Constant) else "{}" for one in parts)
            if re.search(OPTION, text) and " " in text:
                yield path.relative_to(PACKAGE).as_posix(), text


def is_known(module, command, option):
    """Whether the commands that print the message have the option."""
    if command in COMMANDS:
        return option in OPTIONS[command]
    if module.startswith("recordings/"):
        return all(option in OPTIONS[name] for name in COMMANDS_OF.get(module, RECORDINGS))
    of_module = [name for name, place in COMMANDS.items() if f"cli/{place.partition(':')[0]}.py" == module]
    return any(option in OPTIONS[name] for name in of_module or COMMANDS)


def test_a_message_names_options_of_the_command_that_prints_it():
    """What several commands of recordings say names what all of them have, and a key of --read is one."""
    told = [(module, found, text) for module, text in messages() for found in NAMED.finditer(text)]
    wrong = [
        (module, text)
        for module, found, text in told
        if found["option"] != OF_SPEEDS and not is_known(module, found["command"], found["option"])
    ]
    wrong += [(module, text) for module, _, text in told if not set(re.findall("--read ([a-z-]+)=", text)) <= set(KEYS)]
    assert wrong == []
    assert len(told) > 80
