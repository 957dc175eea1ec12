import json

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym.branches.bifurcation_map import bifurcation_map
from chaosgym.cli import app
from chaosgym.errors import ParameterError
from tests.branches.test_branch import SOFT

SOFT_FILE = (
    '[structure]\nfrequencies = "1 Hz"\ndamping_ratios = "2 %"\n[structure.shapes]\nmass = "1 kg^-1/2"\n'
    '[joint]\nat = "mass"\nclearance = "0 mm"\nstops = "one"\nstiffness = "1184 N/m"\ndamping = "3.14 N s/m"\n'
    '[[drive]]\nat = "mass"\nforce = "1 N"\n'
    '[operation]\nspeed = "2.3 Hz"\nspeed_range = "2 to 3 Hz"\nclearance_range = "0 to 10 mm"\n'
)


def test_without_a_gap_motions_change_at_the_same_speed_whatever_the_force():
    """A stop at the place of rest leaves the equations homogeneous: twice the force is twice the motion.

    Three flips are of motions that rest leads to; starts at random add those of coexisting motions. A curve of orbits
    of 36 cycles may be given up, and says so; what was followed of it is as steady.

    Exactly so: a number twice as large is rounded alike, so both rows tell the same also of chaos near a window.
    """
    found = bifurcation_map(SOFT, "speed", "drive_level", (0.38, 0.42), (0.8, 1.6), columns=5, rows=2, workers=1)
    assert found.nature.shape == found.period.shape == (5, 2)
    assert np.all(found.nature == found.nature[:, :1])
    assert np.all(found.period == found.period[:, :1])
    flips = [curve for curve in found.curves if curve.kind == "flip"]
    short = [curve for curve in flips if curve.period <= 12]
    assert len(short) >= 3
    for curve in short:
        assert all(end.startswith("end of the range") for end in curve.ends)
        assert curve.against_values[[0, -1]] == pytest.approx([0.8, 1.6])
    for curve in flips:
        assert all(end.startswith(("end of the range", "not followed beyond")) for end in curve.ends)
        assert curve.along_values == pytest.approx(np.full(len(curve.along_values), curve.along_values[0]), rel=1e-8)


@pytest.mark.parametrize(
    ("against", "other", "message"),
    [
        ("speed", (0.3, 0.5), "speed can't vary along itself"),
        ("drive_level", (2.0, 3.0), "drive_level = 1.2 of the machine is not within 2 to 3"),
        ("drive_level", (1.6, 0.8), "drive_level = 1.2 of the machine is not within 1.6 to 0.8"),
    ],
)
def test_fields_and_ranges_that_make_no_map_are_refused(against, other, message):
    """The same field twice, or a range without the machine's own value."""
    with pytest.raises(ParameterError, match=message):
        bifurcation_map(SOFT, "speed", against, (0.38, 0.45), other)


def test_the_command_draws_curves_over_two_fields(tmp_path):
    """``branch --against`` prints curves, and writes their points and a picture."""
    machine, table, picture = tmp_path / "soft.toml", tmp_path / "curves.csv", tmp_path / "map.png"
    machine.write_text(SOFT_FILE)
    words = ["branch", str(machine), "--along", "speed=2.2:2.4 Hz:3", "--against", "drive_level=0.5:2:2"]
    result = CliRunner().invoke(
        app, [*words, "--workers", "1", "--out", str(table), "--plot", str(picture), "--json"], catch_exceptions=False
    )
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert len(told["nature"]) == 3
    assert len(told["nature"][0]) == 2
    assert told["curves"]
    assert table.read_text().startswith('"curve","kind","period","speed","drive_level"')
    assert picture.stat().st_size > 5000
