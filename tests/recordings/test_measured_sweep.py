"""Types along a measured sweep, against what the thesis reads from figures 3.16 and 4.22."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.measured_sweep import sweep_types
from chaosgym.recordings.runs import RecordingOptions
from chaosgym.recordings.swept_files import judged_sweep

ERROR = 3.0


def peaks_of(levels, scatter, cycles=30, seed=1):
    """Speeds and peaks, ``cycles`` at each speed: a mean, and a largest deviation from it, by speed."""
    generator = np.random.default_rng(seed)
    speeds = np.repeat(list(levels), cycles)
    peaks = np.concatenate([levels[at] + generator.uniform(-scatter[at], scatter[at], cycles) for at in levels])
    return speeds.astype(float), peaks


def regions(speeds, peaks):
    """Type, first and last speed of each region."""
    found = sweep_types(speeds, peaks, sensor_error=ERROR).regions
    return [(one.type, one.first, one.last) for one in found]


def test_a_sweep_like_figure_3_16_b():
    """Rises to 9 Hz, fluctuates to 19 Hz, irregular here and there above: I, II, III as section 3.6 reads it."""
    levels = {f: 5.0 * f for f in range(4, 10)} | {f: 45.0 + 12.0 * (-1) ** f for f in range(10, 31)}
    levels[10] = 30.0
    scatter = {f: 12.0 if f > 19 and f not in (23, 27) else 0.9 * ERROR for f in levels}
    assert regions(*peaks_of(levels, scatter)) == [("I", 4, 9), ("II", 10, 19), ("III", 20, 30)]


def test_a_sweep_like_figure_3_16_a():
    """Nothing irregular: Type I as long as the force does not fall, Type II after."""
    levels = {f: 3.0 * f for f in range(4, 10)} | {f: 20.0 - 8.0 * (f % 2) for f in range(10, 31)}
    assert regions(*peaks_of(levels, dict.fromkeys(levels, 0.9 * ERROR))) == [("I", 4, 9), ("II", 10, 30)]


def test_the_printed_natures_of_figure_4_22():
    """Periodic at 100, 110, 120, 180, 200 and 240 rpm, 20 cycles each: Type III from the first irregular speed on.

    Print calls all of 100 to 250 rpm Type III; the three periodic speeds below 130 rpm are no window in chaos here.
    """
    calm = (100, 110, 120, 180, 200, 240)
    levels = {rpm: 0.3 * rpm for rpm in range(100, 260, 10)}
    scatter = {rpm: 0.9 * ERROR if rpm in calm else 15.0 for rpm in levels}
    speeds, peaks = peaks_of(levels, scatter, cycles=20)
    found = sweep_types(speeds, peaks, sensor_error=ERROR)
    assert [one.speed for one in found.speeds if one.nature == "periodic"] == list(calm)
    assert [(one.type, one.first, one.last) for one in found.regions] == [("I", 100, 120), ("III", 130, 250)]


def test_a_subharmonic_is_periodic():
    """Three levels in turn repeat, far apart as they are (130 rpm of figure 4.22 was "a likely period three")."""
    speeds, peaks = peaks_of({1: 40.0, 2: 45.0, 3: 50.0}, dict.fromkeys((1, 2, 3), 2.0))
    peaks[30:60] += np.tile([-12.0, 0.0, 12.0], 10)
    assert [one.nature for one in sweep_types(speeds, peaks, sensor_error=ERROR).speeds] == ["periodic"] * 3


def test_order_of_the_speeds_does_not_matter():
    """A sweep downwards has the regions of one upwards; a small dip within the error ends no rise."""
    levels = {f: 5.0 * f for f in range(4, 10)} | {10: 43.0, 11: 20.0, 12: 40.0}
    speeds, peaks = peaks_of(levels, dict.fromkeys(levels, 0.1))
    assert regions(speeds, peaks) == regions(speeds[::-1], peaks[::-1]) == [("I", 4, 10), ("II", 11, 12)]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s, p: (s[:59], p[:59]), "2 speeds; a sweep needs 3"),
        (lambda s, p: (s[:100], p[:100]), "has 10 peaks; needed: 16 or more at each speed"),
        (lambda s, p: (np.concatenate([s, s[:30]]), np.concatenate([p, p[:30]])), "comes twice"),
        (lambda s, p: (-s, p), "speed -4 of reading 1 is out of range"),
        (lambda s, p: (np.where(s == 5, np.nan, s), p), "speed nan of reading 31"),
        (lambda s, p: (s, np.where(s == 5, np.inf, p)), "reading inf in cycle 1"),
        (lambda s, p: (s[:-1], p), "allowed: "),
        (lambda s, p: (s[:0], p[:0]), "0 speeds"),
    ],
)
def test_what_is_no_sweep_is_refused(change, message):
    """Each in one line that says what to do."""
    levels = {f: 5.0 * f for f in range(4, 10)}
    with pytest.raises(DiagnosisError, match=message):
        sweep_types(*change(*peaks_of(levels, dict.fromkeys(levels, 1.0))), sensor_error=ERROR)


def test_a_machine_that_never_touches_has_no_irregular_speed():
    """All peaks zero: periodic, and nothing falls."""
    found = sweep_types(np.repeat([1.0, 2.0, 3.0], 16), np.zeros(48), sensor_error=0.0)
    assert [(one.type, one.speeds) for one in found.regions] == [("I", 3)]


@pytest.mark.parametrize(
    ("levels", "route"), [((2.8, 3.2, 3.5, 3.7), "period doubling"), ((2.8, 3.2, 3.7), "not told")]
)
@pytest.mark.parametrize("upwards", [True, False])
def test_two_doublings_before_irregular_motion_name_the_route(levels, route, upwards):
    """Peaks of the logistic map with errors of 0.5 %: periods 1, 2 and 4, then chaos; one doubling tells nothing."""
    generator, speeds, peaks = np.random.default_rng(2), [], []
    for number, r in enumerate(levels if upwards else levels[::-1], 1):
        x = 0.3
        for _ in range(500):
            x = r * x * (1.0 - x)
        for _ in range(60):
            x = r * x * (1.0 - x)
            peaks.append(100.0 * x + generator.uniform(-0.5, 0.5))
            speeds.append(float(number))
    (found,) = sweep_types(speeds, peaks, sensor_error=0.5).beginnings
    assert found.route == route
    assert found.because.startswith("periods: 1 at")
    assert {found.periodic, found.irregular} == ({len(levels) - 1, len(levels)} if upwards else {1, 2})


def test_a_folder_of_one_file_a_speed_is_a_sweep(tmp_path):
    """The same readings in 27 files, or in one, have the same types; speeds in two units are refused."""
    stated = RecordingOptions(sensor_error=3.0)
    heading, *rows = Path("docs/data/sweep.csv").read_text().splitlines()
    by_speed = itertools.groupby(rows, lambda row: row.partition(",")[0])
    for speed, own in by_speed:
        (tmp_path / f"{float(speed):04.1f}.csv").write_text("\n".join([heading, *own]) + "\n")
    whole, parts = judged_sweep("docs/data/sweep.csv", stated), judged_sweep(tmp_path, stated)
    assert parts.types == whole.types
    assert parts.notes[0].endswith("; of 27 files")
    assert judged_sweep(f"{tmp_path}/0*.csv", stated).types.regions[0].last == 7.0
    (tmp_path / "99.csv").write_text("speed [rpm],peak [N]\n" + "5940,30.0\n" * 30)
    with pytest.raises(DiagnosisError, match=r"speeds in rpm, .* in Hz; allowed: one unit"):
        judged_sweep(tmp_path, stated)
