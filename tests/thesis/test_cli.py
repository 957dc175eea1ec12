"""Scorecard and calibration on the command line: wrong input ends in one line, and nothing is written."""

import pytest

from chaosgym.machines import ImpactBeam
from chaosgym.machines.parameters import markdown_table
from tests.cli.run import run


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("scorecard", "--machine", "pendulum"), "'pendulum' is not one of"),
        (("calibrate", "impact-beam", "--budget", "0", "--out", "FOLDER"), "budget = '0' is out of range"),
        (("calibrate", "impact-beam", "--budget", "soon", "--out", "FOLDER"), "budget = 'soon' is out of range"),
        (("calibrate", "impact-beam", "--out", "FOLDER"), "Missing option '--budget'"),
    ],
)
def test_wrong_input_is_refused_in_one_line(arguments, complaint, tmp_path):
    """Exit code 2, one line on standard error that names the value, no folder."""
    folder = tmp_path / "out"
    code, out, err = run(*(str(folder) if word == "FOLDER" else word for word in arguments), module="thesis")
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert complaint in err
    assert not folder.exists()


def test_show_prints_the_table_of_the_documentation():
    """The same lines as the library gives."""
    code, out, _ = run("show", "impact-beam", "--markdown")
    assert code == 0
    assert out.splitlines() == markdown_table(ImpactBeam())
