"""What the README shows works as it stands."""

import re
from pathlib import Path

README = (Path(__file__).parent.parent / "README.md").read_text()


def test_python_snippets_run(capsys):
    """Every Python block runs, and prints what its comments promise."""
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    assert "chaotic" in capsys.readouterr().out


def test_commands_of_the_table_exist():
    """Every command line in the README names an existing command with existing options."""
    from chaosgym.cli import app

    lines = re.findall(r"`chaosgym ([^`]+)`", README)
    assert len(lines) > 8
    for line in lines:
        name, *arguments = line.split()
        known = {option for parameter in app.commands[name].params for option in parameter.opts}
        assert {argument for argument in arguments if argument.startswith("--")} <= known, line
