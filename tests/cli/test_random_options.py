"""Options drawn at random: every command answers as published, or says in one line what it does not understand."""

import os
import random
import shlex

import click
import jsonschema
import pytest
from click.testing import CliRunner

from chaosgym.cli import app
from chaosgym.errors import ChaosgymError
from tests.cli.test_answers import BEAM, DOCS, check

CALLS = {
    "simulate": (
        "impact-beam --cycles 5",
        "slider-crank --cycles 2",
        f"{DOCS}/machines/moon-shaw-1983.toml --cycles 5",
    ),
    "show": ("impact-beam", "slider-crank", f"{DOCS}/machines/cam-follower.toml"),
    "diagnose": ("impact-beam --budget 100", f"{DOCS}/machines/moon-shaw-1983.toml --budget 100"),
    "judge": (f"{DOCS}/data/peaks.csv", f"{DOCS}/data/peaks.csv --read column=upper"),
    "judge-sweep": (f"{DOCS}/data/sweep.csv --sensor-error '3 N'",),
    "run-up": (f"{DOCS}/data/peaks.csv",),
    "monitor": ("",),
    "classify": ("impact-beam", f"impact-beam {DOCS}/data/peaks.csv"),
    "info": ("",),
    "new-machine": ("", "four-bar"),
    "dataset info": (f"{DOCS.parent}/datasets/impact-beam/sample",),
    "design": ("--template impact-beam", f"--template {DOCS}/machines/compressor.toml"),
}
"""Commands that end within a second, each with what it needs."""

SLOW_CALLS = {
    "fit": (f"impact-beam {DOCS}/data/peaks.csv --column upper --sensor-error '1 N' --estimate clearance",),
    "branch": ("impact-beam --fidelity standard --along 'speed=17.3:17.7 Hz:3' --workers 1",),
    "run-agent": (f"{BEAM} --machine 13",),
    "compare": (f"{BEAM} --machines 2 --only 'follow the demand'",),
}
"""Commands that take seconds; one line of each is drawn in the slow tests."""

LINES = int(os.environ.get("CHAOSGYM_LINES", "24"))
"""Lines of each command in the slow test."""

LEFT_OUT = {
    "out",
    "series_out",
    "plot",
    "log",
    "report",
    "fmu",
    "as_json",
    "help",
    "batch",
    "version",
    "types",
    "cycles",
}
"""Options that write files, or take minutes, or are stated already."""

WORDS = (
    *("0", "1", "2", "-1", "nan", "inf", "1e400", "0_1", "", " ", "x", "\u0661", "1 mm", "0.1 mm", "30 Hz", "1800 rpm"),
    *(
        "3 N",
        "1 N",
        "0 N",
        "3 furlong",
        "5 %",
        "upper",
        "column=upper",
        "unit=kN",
        "rate-hz=2 kHz",
        "error=3 N",
        "=",
        "a=b=c",
    ),
    *("clearance=0.1 mm", "excitation_frequency=19 Hz", "clearance=nan", "speed=0", "n_modes=2.5", "no-such-field=1"),
    *("random:1", "rest", "../..", "-", "--", "--json", "12; rm", "\n", "a\nb", "x" * 300),
)


def word(option, draw):
    """A value of an option: one of its choices or of its range, or any word."""
    kind = option.type
    if isinstance(kind, click.Choice) and draw.random() < 0.8:
        return draw.choice([*kind.choices])
    if isinstance(kind, click.IntRange) and draw.random() < 0.8:
        low = 0 if kind.min is None else kind.min
        return str(draw.randint(low, min(low + 60, low + 60 if kind.max is None else kind.max)))
    return draw.choice(WORDS)


def line(name, draw):
    """A command line with up to three options, drawn from those that the command declares."""
    command = app
    for part in name.split():
        command = command.get_command(click.Context(command), part)
    options = [one for one in command.params if isinstance(one, click.Option) and one.name not in LEFT_OUT]
    words = [*name.split(), *shlex.split(draw.choice((CALLS | SLOW_CALLS)[name]))]
    for option in draw.sample(options, min(len(options), draw.randint(0, 3))):
        words.append(draw.choice(option.opts))
        if not option.is_flag:
            words.append(word(option, draw))
    return [*words, "--json"]


def answers(name, draw):
    """Whether a drawn line was answered; fails on any other end than an answer or one line."""
    words = line(name, draw)
    stream = "".join(f"{40 + k % 2}\n" for k in range(40))
    done = CliRunner().invoke(app, words, input=stream, standalone_mode=False)
    if done.exception is None:
        for one in done.stdout.splitlines():
            try:
                check(name.replace(" ", "-"), one)
            except jsonschema.ValidationError as error:
                pytest.fail(f"{shlex.join(words)}: {error.message}")
        return True
    assert isinstance(done.exception, click.ClickException | ChaosgymError | OSError), (words, done.exc_info)
    said = getattr(done.exception, "format_message", lambda: str(done.exception))()
    assert 0 < len(said) < 1000, (words, said)
    assert "\n" not in said.replace("\n\n", ""), (words, said)
    return False


@pytest.mark.parametrize("name", CALLS)
def test_a_dozen_lines_of_random_options(name, tmp_path, monkeypatch):
    """Each is answered by an object of the published schema, or refused in one line."""
    monkeypatch.chdir(tmp_path)
    answered = [answers(name, random.Random(f"{name} {number}")) for number in range(12)]
    assert list(tmp_path.iterdir()) == []
    assert any(answered) or name == "run-up"


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CALLS, *SLOW_CALLS])
def test_many_lines_of_random_options(name, tmp_path, monkeypatch):
    """As the test above."""
    monkeypatch.chdir(tmp_path)
    for number in range(LINES if name in CALLS else max(1, LINES // 24)):
        answers(name, random.Random(f"more of {name} {number}"))
    assert list(tmp_path.iterdir()) == []
