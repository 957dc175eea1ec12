"""Former spellings of commands and options: each is today's command line, and says so in one line."""

import click
import pytest

from chaosgym.cli import COMMANDS as COMMAND_NAMES
from chaosgym.cli import RESPELT, app
from chaosgym.cli.former import COMMANDS, KEYED, OPTIONS, rewritten
from chaosgym.cli.options import KEYS
from chaosgym.cli.sweep import LABELS
from tests.cli.run import run

ROWS = [
    ("diagnose --sweep s.csv --sensor-error 3", "judge-sweep s.csv --sensor-error 3"),
    ("diagnose --run-up --series r.csv --tachometer t", "run-up r.csv --tachometer t"),
    ("diagnose --peaks p.csv impact-beam --estimate gap", "fit impact-beam p.csv --as peaks --estimate gap"),
    ("diagnose arm.toml --series=p.csv", "fit arm.toml p.csv --as series"),
    ("diagnose --peaks - --column 2 --json", "judge - --as peaks --column 2 --json"),
    ("diagnose --series f.csv", "judge f.csv --as series"),
    ("diagnose --frequency-hz 8 impact-beam --step-check", "tradeoff impact-beam --step-check --frequency-hz 8"),
    ("overlay impact-beam --out o.png --peaks p.csv", "overlay impact-beam p.csv --as peaks --out o.png"),
    ("overlay impact-beam --out o.png --series p.csv", "overlay impact-beam p.csv --as series --out o.png"),
    ("classify impact-beam --follow --log l.csv", "monitor --log l.csv"),
    ("classify impact-beam --peaks p.csv", "classify impact-beam p.csv --read as=peaks"),
    ("classify slider-crank --series p.csv", "classify slider-crank p.csv --read as=series"),
    ("design b.toml --beside --peaks p.csv --seed 1", "design --beside p.csv --read as=peaks b.toml --seed 1"),
    ("design a.toml b.toml --series p.csv --beside", "design --beside p.csv --read as=series a.toml b.toml"),
    ("design --peaks p.csv b.toml", "design b.toml --beside p.csv --read as=peaks"),
    ("design b.toml --series p.csv", "design b.toml --beside p.csv --read as=series"),
    ("design --peaks p.csv --load-rating 500 --out r.html", "judge p.csv --as peaks --report r.html --load-rating 500"),
    ("design --out r.html --series p.csv", "judge p.csv --as series --report r.html"),
    ("design --peaks p.csv --load-rating 500", "judge p.csv --as peaks --load-rating 500"),
    ("design --load-rating 500 --series p.csv", "judge p.csv --as series --load-rating 500"),
    ("judge p.csv --load-rating 500 --out r.html", "judge --report r.html p.csv --load-rating 500"),
    ("sweep --random 9 b.toml --seed 2 --out o", "sweep --sampling random:9:2 b.toml --out o"),
    ("sweep b.toml --seed=3 --sobol=9 --budget 100", "sweep --sampling sobol:9:3 b.toml --budget 100"),
    ("sweep b.toml --crosses 5 --seed 1", "sweep --sampling crosses:5:1 b.toml"),
    ("sweep b.toml --random 9", "sweep --sampling random:9 b.toml"),
    ("sweep b.toml --sobol 9", "sweep --sampling sobol:9 b.toml"),
    ("sweep b.toml --crosses 5", "sweep --sampling crosses:5 b.toml"),
    ("sweep b.toml --grid --out o", "sweep --sampling grid b.toml --out o"),
    ("sweep b.toml --seed 3 --out o", "sweep b.toml --out o"),
    ("sweep b.toml --scheduler tcp://h:1", "sweep --workers tcp://h:1 b.toml"),
    ("sweep b.toml --routes --out o", "sweep --label routes=yes b.toml --out o"),
]
"""A former command line of each row of the table, in its order, and what it is today."""


@pytest.mark.parametrize(("number", "former", "current"), [(k, *row) for k, row in enumerate(ROWS)])
def test_each_row_of_the_table_is_rewritten_and_said(number, former, current, capsys):
    """One line on standard error has the command line of today; the row that fits is that of the table."""
    assert rewritten(former.split()) == current.split()
    assert capsys.readouterr().err.endswith(f"; write: chaosgym {current}\n")
    assert set(COMMANDS[number].former.split()) - {
        "MACHINE",
        "BRIEF",
        "FILE",
        "REPORT",
        "NUMBER",
        "SEED",
        "ADDRESS",
    } <= set(former.replace("=", " ").split())


def test_the_table_is_tested_whole():
    """A row without a test is found."""
    assert len(ROWS) == len(COMMANDS)
    assert {row.former.split()[0] for row in COMMANDS} | KEYED.keys() == RESPELT


@pytest.mark.parametrize(
    ("former", "current"),
    [
        (["--hz", "30"], "30 Hz"),
        (["--hz=1800 rpm"], "1800 rpm"),
        (["--rpm", "1800"], "1800 rpm"),
        (["--period-s", "33 ms"], "33 ms"),
        (["--period-s", ".05"], ".05 s"),
    ],
)
def test_a_cycle_keeps_its_unit(former, current):
    """The number of a former option is in its unit; one that states another keeps that."""
    assert {option.former.split()[0] for option in OPTIONS} == {"--hz", "--rpm", "--period-s"}
    today = ["judge", "f.csv", "--as", "series", "--cycle", current]
    assert rewritten(["diagnose", "--series", "f.csv", *former]) == today


def own_options(name):
    """Options of a command itself."""
    return {word for option in app.get_command(click.Context(app), name).params for word in option.opts}


@pytest.mark.parametrize("name", KEYED)
def test_what_was_an_option_is_a_key(name, capsys):
    """Each key that an option was is read, under the same name, by the command that has it no more."""
    option, keys = KEYED[name]
    for key in keys.split():
        assert key in (LABELS if option == "--label" else KEYS)
        assert rewritten([name, "f.csv", f"--{key}", "1"]) == [name, "f.csv", option, f"{key}=1"]
        assert rewritten([name, f"--{key}=1", "f.csv"]) == [name, "f.csv", option, f"{key}=1"]
        assert f"write: chaosgym {name} f.csv {option} {key}=1" in capsys.readouterr().err
    assert own_options(name).isdisjoint(f"--{key}" for key in keys.split())


@pytest.mark.parametrize("name", COMMAND_NAMES)
def test_a_command_has_a_dozen_options_at_most(name):
    """What is seldom stated is a key of one option, so that the help of a command stays short."""
    options = app.get_command(click.Context(app), name).params
    assert len([option for option in options if isinstance(option, click.Option)]) <= 12


@pytest.mark.parametrize("line", ["judge p.csv", "design b.toml --beside p.csv", "simulate impact-beam --series-out s"])
def test_what_is_written_as_today_stays_without_a_word(line, capsys):
    """A command line of today is not touched."""
    assert rewritten(line.split()) == line.split()
    assert capsys.readouterr().err == ""


def test_a_flag_that_is_given_a_value_ends_in_a_refusal():
    """What no row takes away is left to the command, which says so."""
    code, _, told = run("sweep", "impact-beam", "--grid=1", "--out", "map")
    assert code == 2
    assert "--grid" in told.splitlines()[-1]


def test_a_former_command_answers_as_that_of_today(tmp_path):
    """The same object, whichever is written."""
    path = tmp_path / "peaks.csv"
    path.write_text("peak [N]\n" + "40.0\n60.0\n" * 20)
    code, out, err = run("diagnose", "--peaks", path, "--json")
    assert (code, err.count("\n")) == (0, 1)
    assert out == run("judge", path, "--as", "peaks", "--json")[1]
