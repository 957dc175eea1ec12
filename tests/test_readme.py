"""What the README shows works as it stands."""

import re
from pathlib import Path

from chaosgym.machines import MACHINES

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


def sentences(markdown):
    """Sentences of the running text: no code, tables, headings, pictures or comments."""
    text = re.sub(r"```.*?```|<!--.*?-->|!\[[^\]]*\]\([^)]*\)", "\n\n", markdown, flags=re.DOTALL)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    lines = ["" if line.startswith(("|", "#")) else re.sub(r"^- ", "\n", line) for line in text.splitlines()]
    paragraphs = re.split(r"\n\s*\n", "\n".join(lines))
    return [
        one for part in paragraphs for one in re.split(r"(?<=[.!?])(?<!\b[A-Z]\.)\s+", " ".join(part.split())) if one
    ]


def test_the_readme_is_short():
    """At most 600 words and two pictures; sentences of at most 30 words, half of them of at most 15."""
    lengths = sorted(len(sentence.split()) for sentence in sentences(README))
    assert len(README.split()) <= 600
    assert README.count("![") == 2
    assert lengths[-1] <= 30
    assert lengths[len(lengths) // 2] <= 15
