"""What the README shows works as it stands."""

import re
from pathlib import Path

from chaosgym.machines.registry import MACHINES

README = (Path(__file__).parent.parent / "README.md").read_text()


def test_python_snippets_run(capsys):
    """Every Python block runs, and prints what its comments promise."""
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    assert "chaotic" in capsys.readouterr().out


def test_commands_exist():
    """Every command line in the README names an existing command with existing options."""
    from benchmarks.cli import app as benchmarks
    from chaosgym.cli import app as chaosgym
    from thesis.cli import app as thesis

    commands = {"chaosgym": chaosgym, "thesis": thesis, "benchmarks": benchmarks}
    checked = 0
    for house, line in re.findall(r"`(?:python -m )?(chaosgym|thesis|benchmarks) ([^`]+)`", README):
        name, *arguments = line.split()
        command = commands[house].get_command(None, name)
        assert command is not None, line
        if house == "chaosgym" and arguments and hasattr(command, "commands"):
            command = command.commands[arguments[0]]
        known = {option for parameter in command.params for option in parameter.opts}
        machine = known | {option for kind in MACHINES.values() for option in kind.options}
        given = {argument for argument in arguments if argument.startswith("--")}
        assert given <= (machine if "--set" in known else known), line
        checked += 1
    assert checked > 4
