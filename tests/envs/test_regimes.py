"""Regime tables: what they say, and that they are what diagnosis says."""

import numpy as np
import pytest

from chaosgym.diagnosis import diagnose
from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.regimes import HORIZON, RegimeTable, nearest, regimes_of
from chaosgym.machines import THESIS_IMPACT_BEAM
from chaosgym.simulation.batch import at_speed


def _table(pattern: str) -> RegimeTable:
    """One speed for each letter: p for a periodic response, c for a chaotic one."""
    nature = np.array([2 * (letter == "c") for letter in pattern], np.int8)
    return RegimeTable(4.0 + 0.5 * np.arange(len(pattern)), nature, np.ones(len(pattern)), np.ones(len(pattern)))


@pytest.mark.parametrize(
    ("pattern", "type_iii"),
    [("ppp", "..."), ("pcp", ".x."), ("cpc", "xxx"), ("cpp", "x.."), ("pc", ".x"), ("cppc", "x..x"), ("p", ".")],
)
def test_a_periodic_speed_between_two_others_is_type_iii_too(pattern: str, type_iii: str) -> None:
    """A speed counts if its response is not periodic, or if that of both neighbours is not."""
    assert "".join(".x"[value] for value in _table(pattern).type_iii.astype(int)) == type_iii


def test_a_speed_between_two_of_the_table_takes_the_nearest() -> None:
    """Speeds beyond the table take its ends; arrays of any shape are welcome."""
    table = _table("ppcp")
    assert table.is_type_iii(np.array([[4.7, 4.8], [5.2, 5.3]])).tolist() == [[False, True], [True, False]]
    assert table.index_of(np.array([-1.0, 4.0, 99.0])).tolist() == [0, 0, 3]
    assert nearest(np.array([1.0]), np.array([0.3, 7.0])).tolist() == [0, 0]


def test_the_table_is_what_diagnosis_says(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nature and largest force are those of ``diagnose`` from rest; a second call reads the file."""
    monkeypatch.setattr("chaosgym.envs.regimes.KERNEL_CACHE", str(tmp_path))
    drive = SpeedDrive(lowest_speed=19.0, highest_speed=24.0, slew_limit=1.0, regime_spacing=2.5)
    table = regimes_of(THESIS_IMPACT_BEAM, drive.regime_speeds)
    assert table.speeds.tolist() == [19.0, 21.5, 24.0]
    for speed, periodic, peak in zip(table.speeds.tolist(), table.periodic, table.peak_force, strict=True):
        verdict = diagnose(at_speed(THESIS_IMPACT_BEAM, speed), budget=HORIZON)
        assert periodic == (verdict.nature == "periodic")
        assert peak == pytest.approx(verdict.evidence["largest_peak"], rel=0.02)
    assert np.all(table.equivalent_force <= table.peak_force)
    monkeypatch.setattr("chaosgym.envs.regimes.diagnosed", None)
    again = regimes_of(THESIS_IMPACT_BEAM, drive.regime_speeds)
    assert np.array_equal(again.equivalent_force, table.equivalent_force)
