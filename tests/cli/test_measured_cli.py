"""Measured signals on the command line: one reader, one answer; units and files for the next tool."""

import json
import re
import shlex
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from chaosgym.simulation import simulate
from tests.cli.run import run
from tests.plain_modes import HARD_BEAM
from tests.recordings.records import KINDS, make

COMMANDS = (("judge",), ("classify", "impact-beam"), ("judge", "--load-rating", "0.5 kN"))


def written(record, path, style):
    """Write a record as one of five recorders would."""
    rows = enumerate(record.peaks, start=1)
    if style == 0:
        path.write_text("".join(f"{peak:.9g}\n" for peak in record.peaks))
    elif style == 1:
        path.write_text("cycle,peak [N]\n" + "".join(f"{k},{peak:.9g}\n" for k, peak in rows))
    elif style == 2:
        text = "Zyklus;Kraft [N]\n" + "".join(f"{k};{peak:.9g}\n".replace(".", ",") for k, peak in rows)
        path.write_bytes(text.encode("utf-16"))
    elif style == 3:
        path.write_text("stamp\tforce [kN]\n" + "".join(f"{1.7e9 + 0.05 * k:.2f}\t{1e-3 * f:.12g}\n" for k, f in rows))
    else:
        np.save(path.with_suffix(".npy"), record.peaks)
        path.with_suffix(".npy").rename(path)


def check_files(seeds, tmp_path, kinds=tuple(kind for kind in KINDS if "simulated" not in kind)):
    """All three commands say the same nature and period of every file, and a record's life changes nothing of it."""
    for number, (kind, seed) in enumerate((kind, seed) for seed in seeds for kind in kinds):
        record = make(kind, 6000 + seed)
        path = tmp_path / f"{number}.txt"
        written(record, path, number % 5)
        stated = ["as=peaks", *(f"{name.replace('_', '-')}={value:.9g}" for name, value in record.stated.items())]
        options = [word for each in stated for word in ("--read", each)]
        told = []
        for command in COMMANDS:
            code, out, err = run(*command, path, *options, "--json")
            if code == 2 and "cycles are too few for a statistic" in err:
                continue
            assert code == 0, err
            answer = json.loads(out)
            told.append((answer["nature"], answer["period"]))
        assert len(told) >= 2
        assert len(set(told)) == 1, (kind, seed, told)


def test_three_commands_give_one_answer(tmp_path):
    """Five files of as many kinds of trouble, each in another dialect; the hundred files have them all."""
    check_files(range(1), tmp_path, ("strong chaos", "spikes", "drift", "quantised", "missing cycles"))


@pytest.mark.slow
def test_three_commands_give_one_answer_on_forty_files(tmp_path):
    """Forty files."""
    check_files(range(4), tmp_path)


def test_simulated_peaks_are_read_back(tmp_path):
    """``simulate --out`` writes every cycle of both sides; ``judge`` and ``classify`` read the file."""
    for name in ("peaks.csv", "peaks.parquet"):
        path = tmp_path / name
        code, out, err = run(
            "simulate",
            "impact-beam",
            "--frequency-hz",
            "1200 rpm",
            "--cycles",
            80,
            "--transient",
            200,
            "--out",
            path,
            "--json",
        )
        assert code == 0, err
        peaks = json.loads(out)["surfaces_peak_force_N"]["upper"]
        both = json.loads(run("judge", path, "--json")[1])
        assert [one["column"] for one in both["recordings"]] == ["upper", "lower"]
        code, _, err = run("overlay", "impact-beam", path, "--out", tmp_path / "o.png")
        assert code == 2
        assert "'upper', 'lower'; state --read column=NAME" in err
        for command in COMMANDS:
            code, out, err = run(*command, path, "--read", "column=upper", "--json")
            assert code == 0, err
            assert json.loads(out)["period"] == 1
        code, out, _ = run("judge", path, "--column", "upper", "--json")
        assert json.loads(out)["peak_force_summary_N"]["max"] == max(peaks)
        assert run("simulate", "impact-beam", "--out", path)[0] == 2


def test_a_guessed_cycle_stands_in_the_headline(tmp_path):
    """Where the cycle of a series is estimated, the nature of all three commands stands under that condition."""
    path = tmp_path / "series.csv"
    run("simulate", "impact-beam", "--frequency-hz", 20, "--cycles", 40, "--transient", 200, "--series-out", path)
    for command in COMMANDS:
        code, out, err = run(*command, path, "--read", "column=force")
        assert code == 0, err
        assert "periodic, period 1, if the cycle is 50 ms" in out
    code, out, _ = run("judge", path, "--column", "force", "--json")
    assert json.loads(out)["condition"] == "if the cycle is 50 ms"
    code, out, _ = run("judge", path, "--column", "force", "--cycle", "20 Hz")
    assert "if the cycle" not in out


def test_simulated_series_are_read_back(tmp_path):
    """``--series-out`` writes force and motion over time; cycles are found again, chaos is irregular by any of them."""
    path = tmp_path / "series.parquet"
    run("simulate", "impact-beam", "--frequency-hz", 27.5, "--cycles", 300, "--transient", 200, "--series-out", path)
    assert len(pq.read_table(path)) == 300 * 256
    for cycle in ("27.5 Hz", "1650 rpm", "36.363636363636 ms"):
        code, out, err = run("judge", path, "--cycle", cycle, "--sensor-error", "1 N", "--json")
        assert code == 0, err
        verdict = json.loads(out)
        assert verdict["nature"] == "undetermined"
        assert verdict["reason"].startswith("irregular beyond 1 N")
        assert verdict["tells_more"]
    assert run("classify", "impact-beam", path, "--read", "cycle=27.5 Hz")[0] == 0
    assert run("judge", "--load-rating", "500 N", path, "--read", "cycle=27.5 Hz")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("judge", "-", "--sensor-error", "inf"), "is no finite number"),
        (("judge", "-", "--sensor-error", "3 furlong"), "is in furlong, no unit that is known; allowed: N, kN"),
        (("judge", "-", "--sensor-sigma", "1"), "has no option --sensor-sigma; state --read sensor-sigma=VALUE"),
        (("classify", "impact-beam", "-", "--column", "2"), "has no option --column; state --read column=VALUE"),
        (("diagnose", "impact-beam", "--column", "2"), "diagnose has no option --column; allowed: --frequency-hz"),
        (("judge", "-", "--sensor-error", "3 m"), "in m, the readings are in N"),
        (
            ("judge", "-", "--read", "unit=Newtn"),
            "column 'column 1' is in Newtn, no unit that is known; did you mean newton?",
        ),
        (("judge", "-", "--frequncy-hz", "3"), "judge has no option --frequncy-hz; allowed: --column, --as, --rate-hz"),
        (("diagnose", "impact-beam", "--sensor-error", "inf"), "is no finite number"),
        (("diagnose", "impact-beam", "--sensor-error", "3 m"), "unknown unit 'm' (allowed: N, kN"),
        (("judge", "-", "--cycle", "20"), "--cycle = '20' has no unit (allowed: Hz, kHz, rpm, s, ms"),
        (
            ("judge", "-", "--as", "peaks", "--cycle", "20 Hz"),
            "a cycle of 0.05 s is stated, which one",
        ),
        (("judge", "-", "--read", "tachometer=1", "--cycle", "20 Hz"), "a tachometer and a cycle are stated"),
        (("judge", "-", "--read", "pulses-per-revolution=2"), "allowed: with a tachometer"),
        (("judge", "-", "--sensor-error", "1", "--read", "sensor-sigma=1"), "given twice"),
        (("judge", "-", "--read", "tachometr=1"), "--read has no key 'tachometr'; did you mean tachometer?"),
        (("classify", "impact-beam", "-", "--sensor-error", "nan"), "is no finite number"),
        (("judge", "-", "--as", "series"), "no time column; use --read rate-hz="),
        (("diagnose", "impact-beam", "--test", "mut", "--types"), "go with --test adaptive, not with mut"),
        (
            ("simulate", "impact-beam", "--clearance-mm", "0.1 furlong"),
            "unknown unit 'furlong' (allowed: m, mm, um, in, mil, thou)",
        ),
        (("simulate", "impact-beam", "--set", "clearance=0.1 kg"), "unknown unit 'kg'"),
        (("simulate", "impact-beam", "--out", "peaks.xls"), "allowed: .csv, .parquet"),
        (("simulate", "impact-beam", "--out", "nowhere/peaks.csv"), "is no folder"),
    ],
)
def test_wrong_options_end_in_one_line(arguments, message):
    """Exit code 2, nothing on standard output, one line that says what is allowed."""
    code, out, err = run(*arguments, stdin="48.9\n48.8\n" * 20)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("value", ["1e308", "1e-320", "0"])
def test_extreme_peaks_end_in_one_line_or_a_plain_answer(value):
    """1e308 N and 1e-320 N are refused by all; all zeros are no contact."""
    for command in COMMANDS:
        code, out, err = run(*command, "-", stdin=f"{value}\n" * 60)
        assert (code == 2 and len(err.strip().splitlines()) == 1) or "no contact" in out
        assert value == "0" or "1e+308 is no reading of a sensor" in err or "0, or 1e-100 N and more" in err


@pytest.mark.parametrize("title", ["acc [g]", "force [N]"])
@pytest.mark.parametrize("kind", ["peaks", "series"])
def test_readings_that_no_computer_can_square_end_in_one_line(title, kind):
    """One of 1e308 among many, as a recorder's mark, and one of -1e308: nothing overflows, and the line is named."""
    readings = np.sin(0.3 * np.arange(400))
    readings[[100, 200]] = 1e308, -1e308
    table = f"{title}\n" + "".join(f"{value:.6g}\n" for value in readings)
    code, out, err = run("judge", "-", "--as", kind, *(("--rate-hz", "1000") if kind == "series" else ()), stdin=table)
    assert (code, out) == (2, "")
    name = title.split()[0]
    assert err.strip() == (
        f"Error: standard input, column '{name}', line 102: 1e+308 is no reading of a sensor; allowed: up to 1e+100"
    )


def test_units_are_understood_by_options_fields_and_axes(tmp_path):
    """0.1 mm, 100 µm and 1e-4 in SI are one clearance; 19 Hz are 1140 rpm."""
    ways = (
        ("--clearance-mm", "0.1", "--frequency-hz", "19"),
        ("--clearance-mm", "100 µm", "--frequency-hz", "1140 rpm"),
        ("--set", "clearance=0.1 mm", "--set", "excitation_frequency=0.019 kHz"),
        ("--set", "clearance=1e-4", "--set", "excitation_frequency=19"),
    )
    shown = [json.loads(run("show", "impact-beam", *way, "--json")[1])["parameters"] for way in ways]
    for parameters in shown:
        assert parameters["clearance"] == pytest.approx(1e-4, rel=1e-12)
        assert parameters["excitation_frequency"] == pytest.approx(19.0, rel=1e-12)
    axes = ("--axis", "clearance=0.1 mm:120um:2", "--axis", "excitation_frequency=600 rpm:20 Hz:2")
    code, _, err = run(
        "sweep", "impact-beam", *axes, "--budget", 100, "--label", "full-types=0", "--out", tmp_path / "s"
    )
    assert code == 0, err
    table = pq.read_table(tmp_path / "s" / "sweep.parquet")
    assert sorted(set(table["excitation_frequency"].to_pylist())) == [10.0, 20.0]
    np.testing.assert_allclose(sorted(set(table["clearance"].to_pylist())), [1e-4, 1.2e-4])


def test_millimetres_taken_for_metres_and_no_contact_are_said():
    """A gap of 127 mm is doubted, and that it is never closed is said."""
    code, out, err = run("simulate", "impact-beam", "--set", "clearance=0.127", "--cycles", "5")
    assert code == 0
    assert "for millimetres write '0.127 mm'" in err
    assert "no contact at all" in out
    _, _, err = run("simulate", "impact-beam", "--set", "clearance=0.127 mm", "--cycles", "5")
    assert "millimetres" not in err


def test_commands_of_the_documentation_run(tmp_path, monkeypatch):
    """Three commands from the sample to a report, one that makes such a file, both sensors, and the model beside it."""
    root = Path(__file__).parent.parent.parent
    page = (root / "docs" / "recordings.md").read_text()
    commands = [shlex.split(line)[1:] for line in re.findall(r"^    (chaosgym .*)$", page, re.MULTILINE)]
    assert [command[0] for command in commands] == ["judge", "classify", "judge", "simulate", "judge", "judge", "fit"]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs" / "data").mkdir(parents=True)
    for name in ("periodic.csv", "peaks.csv"):
        (tmp_path / "docs" / "data" / name).write_bytes((root / "docs" / "data" / name).read_bytes())
    sample = tmp_path / "docs" / "data" / "peaks.csv"
    for command in (*commands[:3], commands[4]):
        code, out, err = run(*command)
        assert code == 0, err
        assert "periodic, period 1" in out
    assert "Life of the surface" in (tmp_path / "report.html").read_text()
    assert "Life of the surface" not in (tmp_path / "recording.html").read_text()
    assert "together: random or chaotic, these sensors cannot tell" in run(*commands[5])[1]
    told = re.search(r"agree; without noise their machines are chaotic (\d+)", run(*commands[6])[1])
    assert told is not None
    assert int(told[1]) >= 90  # rounding decides about single records of chaos
    shipped = sample.read_text().splitlines()
    assert run(*commands[3], "--overwrite")[0] == 0
    made = sample.read_text().splitlines()
    assert (len(made), made[0]) == (len(shipped), shipped[0])


def test_both_surfaces_tell_what_neither_tells_alone(tmp_path):
    """The chaos of a beam on a hard pivot (30 Hz, 0.127 mm), to sensors that err by 0.1 %."""
    peaks = simulate(HARD_BEAM, 500, transient=200).peak_force
    peaks *= 1.0 + 1e-3 * np.random.default_rng(0).normal(size=peaks.shape)
    path = tmp_path / "both.csv"
    np.savetxt(path, peaks, "%.4f", ",", header="upper,lower", comments="")
    out = run("judge", path, "--column", "upper,lower", "--sensor-error", "1 N")[1]
    assert "together  chaotic" in out
    assert out.count("undetermined") == 2


def test_what_a_sweep_wrote_is_classified(tmp_path):
    """Every row of a sweep describes its machine, so that ``classify --batch`` reads it."""
    axes = ("--axis", "clearance=0.1 mm:0.12 mm:2", "--axis", "excitation_frequency=10:20:2")
    assert (
        run("sweep", "impact-beam", *axes, "--budget", 100, "--label", "full-types=0", "--out", tmp_path / "s")[0] == 0
    )
    out = tmp_path / "answers.parquet"
    code, _, err = run("classify", "impact-beam", "--batch", tmp_path / "s" / "sweep.parquet", "--out", out)
    assert code == 0, err
    answers = pq.read_table(out)
    assert len(answers) == 4
    assert answers["clearance"].to_pylist() == pq.read_table(tmp_path / "s" / "sweep.parquet")["clearance"].to_pylist()


COARSE = ("--axis", "clearance=0.1 mm:0.14 mm:2", "--axis", "excitation_frequency=4:26:2:log")


def test_a_coarse_sweep_types_its_points_by_runs_of_their_own(tmp_path):
    """Speeds of 4 and 26 Hz are no neighbours; four points take seconds, so each is judged over its own tolerances."""
    command = ("sweep", "impact-beam", *COARSE, "--budget", 100, "--out", tmp_path / "s", "--json")
    code, out, err = run(*command)
    assert code == 0, err
    answer = json.loads(out)
    assert "I" in answer["response_type"]
    assert answer["calm"]["ranges"]
    plan = json.loads((tmp_path / "s" / "plan.json").read_text())
    assert plan["full_types"] == 1.0
    again = run(*command)
    assert again[:2] == (0, out)


def test_a_coarse_sweep_without_types_calls_nothing_type_ii(tmp_path):
    """Chaotic points are III, the others are left open, and that is said."""
    command = (
        "sweep",
        "impact-beam",
        *COARSE,
        "--budget",
        100,
        "--label",
        "full-types=0",
        "--out",
        tmp_path / "s",
        "--json",
    )
    code, out, err = run(*command)
    assert code == 0, err
    answer = json.loads(out)
    assert set(answer["response_type"]) <= {"III", "undetermined"}
    assert any("tolerances were not checked" in warning for warning in answer["warnings"])


def test_a_design_tells_its_source_and_no_examples(tmp_path):
    """Without a strength there is no reliability; the file, its hash and the date are in the report."""
    path, page = tmp_path / "peaks.csv", tmp_path / "report.html"
    path.write_text("cycle,peak [N]\n" + "".join(f"{k},{50 + k % 2}\n" for k in range(60)))
    code, out, err = run("judge", path, "--load-rating", "500", "--report", page)
    assert code == 0, err
    assert out.startswith("periodic, period 2: every cycle loads the surface alike")
    assert "no reliability" in out
    numbers = json.loads(page.with_suffix(".json").read_text())
    assert numbers["evaluation"]["reliability"] is None
    assert numbers["criteria"] == {"load_rating": 500.0}
    assert numbers["source"]["sha256"] in page.read_text()
    assert numbers["source"]["date"] in page.read_text()
    assert "Reliability over" not in page.read_text()
    assert "GPa" not in page.read_text()
    path.write_text("cycle,peak [N]\n" + "".join(f"{k},{50 + k % 2}\n" for k in range(6)))
    code, _, err = run("judge", path, "--load-rating", "500")
    assert code == 2
    assert "8 or more" in err


SWEEP = Path(__file__).parents[2] / "docs" / "data" / "sweep.csv"


def test_a_measured_sweep_is_told_by_types(tmp_path):
    """The documentation's sweep: rises to 7 Hz, fluctuates, irregular from 22 Hz on; a picture of it."""
    code, out, _ = run("judge-sweep", SWEEP, "--sensor-error", "3 N", "--plot", tmp_path / "s.png", "--json")
    assert code == 0
    told = json.loads(out)
    assert [(one["type"], one["first"], one["last"]) for one in told["regions"]] == [
        ("I", 4, 7),
        ("II", 8, 21),
        ("III", 22, 30),
    ]
    assert (told["speed_column"], told["speed_unit"], len(told["speeds"])) == ("frequency", "Hz", 27)
    assert (tmp_path / "s.png").stat().st_size > 10_000
    code, out, _ = run("judge-sweep", SWEEP, "--read", "sensor-sigma=1.73 N")
    assert code == 0
    assert "Type III  29 to 30 Hz" in out


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("speed,peak\n1,2\n", (), "needs the sensor's error"),
        ("speed,peak\n1,2\n", ("--sensor-error", "3 N"), "1 speeds; a sweep needs 3"),
        ("a,b\n1,2\n3,4\n", ("--sensor-error", "3 N"), "no column that says it is a speed; use --speed-column NAME"),
        ("a,b\n1,2\n3,4\n", ("--speed-column", "c"), "has no column 'c'"),
        ("speed,rpm,peak\n1,2,3\n4,5,6\n", ("--sensor-error", "3 N"), "several columns that could be the speed"),
        ("speed,peak\n1,2\nx,4\n", ("--sensor-error", "3 N"), "line 3: 'x'"),
        ("speed,peak\n1,-2\n1,3\n", ("--sensor-error", "3 N"), "is a negative force"),
        ("speed [Hz]\n1\n2\n", ("--sensor-error", "3 N"), "--read column=NAME"),
        ("", ("--sensor-error", "3 N"), "holds no numbers"),
    ],
)
def test_a_sweep_that_is_none_is_refused_in_one_line(tmp_path, text, options, message):
    """Exit code 2, and what to do."""
    path = tmp_path / "sweep.csv"
    path.write_text(text)
    code, out, err = run("judge-sweep", path, *options)
    assert (code, out) == (2, "")
    assert message in err
    assert err.rstrip().splitlines()[-1].startswith("Error: ")


def test_the_unit_of_a_column_is_asked_for_where_it_is_unknown():
    """The one column of readings is found, so that its unit is what is left to state."""
    table = "cycle,force [furlong]\n" + "".join(f"{n},{40 + n % 2}\n" for n in range(60))
    code, _, err = run("judge", "-", stdin=table)
    assert code == 2
    assert "column 'force' is in furlong, no unit that is known; state its unit, such as --read unit=N" in err
    assert run("judge", "-", "--read", "unit=N", stdin=table)[0] == 0


@pytest.mark.parametrize(
    ("error", "stated"),
    [("0.05 m/s2", 0.05), ("0.05 m/s^2", 0.05), ("5e-2m/s²", 0.05), ("0.05g", 0.49), ("50 mg", 0.49)],
)
@pytest.mark.parametrize(("unit", "size"), [("m/s^2", 1.0), ("m/s²", 1.0), ("g", 9.80665), ("mg", 9.80665e-3)])
def test_the_error_of_a_sensor_is_understood_in_every_spelling(unit, size, error, stated):
    """Half a hundredth of g is 0.49 m/s², in readings of either unit."""
    rng = np.random.default_rng(0)
    readings = "".join(f"{a:.6f}\n" for a in 3.0 + 0.001 * rng.normal(size=60))
    code, out, err = run("judge", "-", "--sensor-error", error, "--json", stdin=f"acc [{unit}]\n{readings}")
    assert code == 0, err
    told = json.loads(out)["sensor_error"]["half_width"]
    assert told == pytest.approx(stated / size, rel=1e-2)


def test_an_acceleration_is_judged_in_its_own_unit(tmp_path):
    """g stays g in every sentence; life asks for a force, which a calibration gives."""
    path = tmp_path / "peaks.csv"
    rng = np.random.default_rng(0)
    path.write_text("Acc [g]\n" + "".join(f"{a:.5f}\n" for a in 3.0 + 0.01 * rng.normal(size=200)))
    code, out, _ = run("judge", path, "--sensor-error", "0.05 g")
    assert code == 0
    assert "periodic, period 1" in out
    assert " N" not in out
    told = json.loads(run("judge", path, "--json")[1])
    assert told["unit"] == "g"
    assert told["peak_summary"]["mean"] == pytest.approx(3.0, rel=0.01)
    code, _, err = run("judge", path, "--sensor-error", "0.05 mV")
    assert code == 2
    assert "in mV, the readings are in g" in err
    code, _, err = run("judge", path, "--load-rating", "500 N")
    assert code == 2
    assert (
        f"asks for a force; name a column of one by --read column=NAME, or judge it as it is: chaosgym judge {path}"
        in err
    )
    assert run("judge", path, "--load-rating", "500 N", "--read", "scale=0.02 g/N")[0] == 0
    code, out, _ = run("judge", path, "--read", "scale=0.02 g/N")
    assert code == 0
    assert "mean 150.0" in out
    assert run("judge", path, "--plot", tmp_path / "g.png")[0] == 0


@pytest.fixture
def recordings(tmp_path):
    """A folder with two sensors that repeat, an acceleration, and a text without numbers."""
    rng = np.random.default_rng(6)
    two = np.tile([40.0, 60.0], 60)[:, None] + 0.05 * rng.normal(size=(120, 2))
    folder = tmp_path / "run 7"
    folder.mkdir()
    np.savetxt(folder / "a.csv", two, delimiter=",", header="front [N],rear [N]", comments="")
    np.savetxt(folder / "b.csv", 3.0 + 0.02 * rng.normal(size=120), header="acc [g]", comments="")
    (folder / "notes.txt").write_text("nothing here")
    return folder


def test_columns_are_named_by_patterns_lists_and_numbers(recordings):
    """Every way to name both columns gives a line each and one together; one column gives the full answer."""
    for column in ("front,rear", "*", "1,2", "re*,FRONT", "front, front ,2"):
        code, out, _ = run("judge", recordings / "a.csv", "--column", column, "--json")
        told = json.loads(out)
        assert code == 0
        assert {one["column"] for one in told["recordings"]} == {"front", "rear"}
        assert [(one["nature"], one["period"]) for one in told["together"]] == [("periodic", 2)]
    code, out, _ = run("judge", recordings / "a.csv", "--column", "re*", "--json")
    assert (code, json.loads(out)["column"]) == (0, "rear")
    code, _, err = run("judge", recordings / "a.csv", "--column", "front,side*")
    assert (code, err.count("\n")) == (2, 1)
    assert "has no column 'side*'; its columns of numbers: 'front', 'rear'" in err
    code, _, err = run("fit", "impact-beam", recordings / "a.csv", "--column", "*")
    assert (code, err.count("\n")) == (2, 1)
    assert "columns 'front', 'rear' are compared with surfaces of impact-beam; allowed: upper, lower" in err
    code, _, err = run("judge", recordings / "a.csv", "--column", "*", "--load-rating", "500 N")
    assert (code, err.count("\n")) == (2, 1)
    assert "column='*' means 'front', 'rear'; allowed here: one column" in err


def test_a_folder_or_a_pattern_gives_a_table(recordings):
    """A line for every channel of every file, in its own unit; what is no recording is named once, and counted."""
    (recordings / "empty.csv").write_text("")
    picture = recordings.parent / "page.png"
    code, out, _ = run("judge", recordings, "--plot", picture)
    assert code == 0
    assert picture.stat().st_size > 10_000
    rows = out.splitlines()
    assert rows[0].split() == ["file", "channel", "verdict", "scatter", "cycles"]
    channels = [("a.csv", "front"), ("a.csv", "rear"), ("a.csv", "together"), ("b.csv", "acc")]
    assert [tuple(row.split()[:2]) for row in rows[1:5]] == channels
    assert "  2 of 4 files are no recordings: empty.csv, notes.txt" in rows
    assert out.count("notes.txt") == 1
    (recordings / "short.csv").write_text("force [N]\n1\n2\n")
    out = run("judge", recordings)[1]
    assert out.count("short.csv") == 1
    assert "short.csv: the record has 2 cycles" in out
    code, out, _ = run("judge", recordings / "[ab].csv", "--json")
    told = json.loads(out)
    assert (code, told["not_judged"]) == (0, [])
    assert [one["unit"] for one in told["recordings"]] == ["N", "N", "g"]
    for source, message in ((recordings / "c*.csv", "holds no file"), (recordings / "notes*", "holds no numbers")):
        code, _, err = run("judge", source)
        assert (code, err.count("\n")) == (2, 1)
        assert message in err


PEAKS = Path(__file__).parents[2] / "docs" / "data" / "peaks.csv"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["impact-beam", PEAKS, "--column", "upper", "--estimate", "hue"], "'hue' can't be estimated"),
        (["impact-beam", PEAKS, "--column", "upper", "--read", "sensor-sigma=-1"], "out of range"),
    ],
)
def test_a_record_beside_a_machine_is_refused_in_one_line(arguments, message):
    """What does not go together, and what is no parameter."""
    code, _, err = run("fit", *arguments)
    assert (code, err.count("\n")) == (2, 1)
    assert message in err


def test_a_recording_that_takes_long_shows_a_sign_of_life(tmp_path, monkeypatch):
    """The reader says after a while that it goes on."""
    from chaosgym.recordings import runs

    def slow(source, found=runs.read_recording, **where):
        time.sleep(1.0)
        return found(source, **where)

    monkeypatch.setattr("chaosgym.cli.output.PATIENCE_SECONDS", 0.01)
    monkeypatch.setattr(runs, "read_recording", slow)
    np.savetxt(tmp_path / "peaks.csv", 10.0 + np.sin(np.arange(40.0)))
    code, _, err = run("judge", tmp_path / "peaks.csv", "--sensor-error", "1 N")
    assert code == 0
    assert "read and judge the recording: " in err
