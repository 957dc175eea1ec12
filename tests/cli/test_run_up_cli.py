"""``run-up`` on the command line."""

import json
import re

import numpy as np
import pytest

from tests.cli.run import run
from tests.cli.test_answers import check

TIME = np.arange(0.0, 30.0, 1.0 / 4_000.0)
ANGLE = 6.0 * TIME + 0.3 * TIME**2


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A run-up from 360 to 1440 rpm: order 1 of 2 g and order 3.5 of 0.5 g, a tachometer of four pulses, one missed."""
    path = tmp_path_factory.mktemp("run-up") / "run.csv"
    value = 3.0 + 2.0 * np.cos(2.0 * np.pi * ANGLE) + 0.5 * np.cos(7.0 * np.pi * ANGLE)
    number, phase = np.divmod(4.0 * ANGLE, 1.0)
    pulses = 5.0 * ((phase < 0.4) & (number != 333))
    rows = zip(TIME, value, pulses, strict=True)
    text = "time [s],bearing [g],tacho [V]\n" + "".join(f"{t:.5f},{v:.5f},{p:.0f}\n" for t, v, p in rows)
    path.write_text(text)
    return path


OF_FILE = ("--column", "bearing", "--tachometer", "tacho", "--pulses-per-revolution", "4")


def test_a_run_up_is_told_in_lines_in_json_and_as_a_picture(recording, tmp_path):
    """Turns, the missed pulse, both orders in g, and the types of two alternating levels: one answer in three forms."""
    picture = tmp_path / "run.png"
    of_run = ("run-up", recording, *OF_FILE, "--sensor-error", "0.05 g")
    code, out, err = run(*of_run, "--plot", picture)
    assert code == 0, err
    assert "order 1      up to 2 g at" in out
    assert re.search(r"order 3\.5 +up to 0\.(5|49\d*|50\d+) g at", out)
    assert "pulses mended: 1 missed" in out
    assert picture.stat().st_size > 10_000
    code, out, _ = run(*of_run, "--json")
    check("run-up", out)
    told = json.loads(out)
    assert told["turns"] == pytest.approx(ANGLE[-1], abs=0.6)
    assert (told["missed_pulses"], told["unit"]) == (1, "g")
    assert [region["type"] for region in told["types"]["regions"]] == ["I"]


def test_a_tachometer_of_several_pulses_cuts_the_cycles_of_other_commands(recording):
    """``judge`` takes the turns for cycles: 449 of them, not four times as many."""
    of_file = ("--column", "bearing", "--read", "tachometer=tacho", "--read", "pulses-per-revolution=4")
    code, out, err = run("judge", recording, *of_file, "--sensor-error", "0.05 g", "--json")
    assert code == 0, err
    assert any("448 cycles" in note or "449 cycles" in note for note in json.loads(out)["warnings"])


def test_a_tachometer_may_be_named_by_its_number(recording):
    """As any other column."""
    by_name, by_number = (
        run("run-up", recording, *OF_FILE, "--tachometer", name, "--json")[1] for name in ("tacho", "3")
    )
    assert by_name
    assert by_number == by_name


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ((), "a run-up needs a tachometer; state --tachometer NAME"),
        (("--tachometer", "bearing", "--column", "bearing"), "can't be both tachometer and signal"),
        (
            ("--column", "bearing", "--tachometer", "speed"),
            "'speed'; its columns of numbers: ",
        ),
        ((*OF_FILE, "--orders", "nan"), "Invalid value for '--orders': 'nan' is no number"),
        ((*OF_FILE[:-1], "400"), "turns, 400 pulses each; needed: 12 turns or more"),
        ((*OF_FILE, "--orders", "300"), "order 300 at .* allowed: up to order"),
        (("--pulses-per-revolution", "4"), "allowed: with a tachometer"),
    ],
)
def test_what_is_no_run_up_is_refused_in_one_line(recording, options, why):
    """Each says what to do."""
    code, out, err = run("run-up", recording, *options)
    assert (code != 0, out) == (True, "")
    assert re.search(why, err)
    assert len(err.strip().splitlines()) <= 3
    assert "Traceback" not in err
