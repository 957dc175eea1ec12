"""The command line keeps its contract: JSON keys, exit codes, one clear line for bad input."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym import read_machine
from chaosgym.cli import app
from chaosgym.cli.design import _announce
from chaosgym.machines import ImpactBeam
from chaosgym.machines.accuracy import accuracy_of
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import simulate
from tests.cli.run import run, run_json


def test_simulate_prints_the_peaks_of_simulate():
    """The numbers are those of the library, of the surface with the largest, one a cycle from rest.

    The model is the cheapest within 1 %, and the answer says which, and how far off it may be.
    """
    result = run_json("simulate", "impact-beam", "--frequency-hz", "19", "--clearance-mm", "0.1", "--cycles", "30")
    beam = ImpactBeam(excitation_frequency=19.0, clearance=0.1e-3, fidelity="1 %")
    record = simulate(beam, 30)
    assert result["model"] == {**accuracy_of(beam).as_dict(), "tolerance": 0.01}
    assert result["peak_force_N"] == record.peak_force[:, record.worst_side].tolist()
    assert result["surfaces_peak_force_N"] == dict(zip(("upper", "lower"), record.peak_force.T.tolist(), strict=True))
    assert result["impacts"] == record.impacts.sum(axis=1).tolist()
    assert 0.0 < result["seconds_per_cycle"] < 1.0


def told_times(arguments, patience, tmp_path, monkeypatch):
    """How often a command, which may take so many seconds without a word, says how long it will take."""
    monkeypatch.setattr("chaosgym.cli.output.PATIENCE_SECONDS", patience)
    code, _, err = run(*(str(tmp_path / "out.parquet") if word == "OUT" else word for word in arguments))
    assert code == 0
    told = re.compile(
        rf"^{arguments[0]}(, before it follows orbits)?: up to about [0-9.e+-]+ (min|s|ms|µs|ns) of processor time$",
        re.MULTILINE,
    )
    return len(told.findall(err))


@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "impact-beam", "--cycles", "5"),
        ("diagnose", "impact-beam", "--frequency-hz", "19"),
        ("sweep", "impact-beam", "--axis", "clearance=1e-4:2e-4:2", "--label", "full-types=0", "--out", "OUT"),
        ("compare", "chaosgym/ImpactBeam-v1", "--machines", "2", "--only", "follow the demand", "--out", "OUT"),
        ("run-agent", "chaosgym/ImpactBeamTolerance-v1"),
        ("branch", "impact-beam", "--along", "speed=10:10.1:2"),
    ],
)
def test_what_takes_long_says_beforehand_about_how_long(tmp_path, monkeypatch, arguments):
    """In processor time, by a few cycles of the machine."""
    assert told_times(arguments, 1e-9, tmp_path, monkeypatch) == 1


def test_what_takes_seconds_says_nothing_of_it(tmp_path, monkeypatch):
    """Nobody asks how long a command takes that ends before he has read the answer."""
    assert told_times(("simulate", "impact-beam", "--cycles", "5"), 3600.0, tmp_path, monkeypatch) == 0


@pytest.mark.parametrize(("hertz", "ends"), [(9.0, 2), (30.0, 1)])
def test_design_tells_a_range_of_time_where_the_nominal_machine_is_periodic(hertz, ends, capsys):
    """A proof ends a diagnosis early, so that machines like a periodic one take a part of the most; chaos takes all."""
    _announce(ImpactBeam(excitation_frequency=hertz), 1_000_000)
    told = capsys.readouterr().err
    assert len(re.findall(r"\d (?:s|min|h)\b", told)) == ends, told
    assert ("where none is periodic" in told) == (ends == 2)


def test_the_answer_names_a_model_that_is_stated_and_warns_of_it():
    """A rung stays what it is; where its error is beyond what is documented, a note says so. A field of it likewise."""
    stiff = ("--frequency-hz", "10", "--set", "contact_stiffness=2.4e8", "--cycles", "2")
    result = run_json("simulate", "impact-beam", "--fidelity", "standard", *stiff)
    assert result["model"]["rung"] == "standard"
    assert result["model"]["tolerance"] is None
    assert result["model"]["warning"] in result["notes"]
    assert "documented to be within" in run("simulate", "impact-beam", "--fidelity", "standard", *stiff)[1]
    result = run_json("simulate", "impact-beam", "--set", "n_modes=5", "--set", "fitted_modes=0", "--cycles", "2")
    assert result["model"]["numbers"] == {"n_modes": 5, "fitted_modes": 0}
    assert result["model"]["estimated_error"] > 0.1
    text = run("simulate", "impact-beam", "--fidelity", "0.2%", "--frequency-hz", "12", "--cycles", "2")[1]
    assert "model: fine (n_modes 10, fitted_modes 2); estimated error of the peak force" in text
    assert ", asked 0.2 %" in text


@pytest.mark.parametrize(
    ("more", "nature"),
    [(("--frequency-hz", "19", "--fidelity", "standard"), "periodic"), (("--frequency-hz", "30"), "chaotic")],
)
def test_diagnose_tells_the_printed_natures(more, nature):
    """At +-0.127 mm the thesis prints periodic at 19 Hz and chaotic at 30 Hz (figures 3.6 and 3.7).

    At 19 Hz few modes are as good as those of the thesis: by finer models the motion there is on the brink of a change.
    """
    result = run_json("diagnose", "impact-beam", *more, "--clearance-mm", "0.127")
    assert result["nature"] == nature
    assert (result["period"] == 1) == (nature == "periodic")
    assert set(result["peak_force_summary_N"]) == {"min", "max", "mean", "std"}
    assert result["evidence"]


TWO_MASSES = """
[structure]
matrices = "two.npz"
modes = 2
damping_ratios = "2 %"
[joint]
at = "load - motor"
clearance = "0.2 mm"
stiffness = "0.5 N/um"
damping = "30 N s/m"
[[drive]]
at = "motor"
force = "20 N"
[operation]
speed = "30 Hz"
speed_range = "10 to 60 Hz"
clearance_range = "0.05 to 0.5 mm"
"""


@pytest.fixture(scope="module")
def two_masses(tmp_path_factory):
    """File of masses of 3 and 1 kg, each on 2 kN/m, with a gap between them."""
    folder = tmp_path_factory.mktemp("machine")
    np.savez(folder / "two.npz", M=np.diag([3.0, 1.0]), K=np.diag([2000.0, 2000.0]), names=["load", "motor"])
    path = folder / "two.toml"
    path.write_text(TWO_MASSES)
    return str(path)


@pytest.mark.parametrize("command", ["simulate", "diagnose"])
def test_a_machine_with_one_stop_has_one_surface(command):
    """Nothing is printed of a lower stop that is not there."""
    path = str(Path(__file__).parents[2] / "docs" / "machines" / "shaw-holmes-1983.toml")
    told = CliRunner().invoke(app, [command, path])
    assert "upper" in told.stdout
    assert "lower" not in told.stdout
    assert list(json.loads(CliRunner().invoke(app, [command, path, "--json"]).stdout)["surfaces_peak_force_N"]) == [
        "upper"
    ]


@pytest.mark.parametrize(
    ("machine", "forces"),
    [("two_masses", (36.5763, 74.1986)), ("docs/machines/kahraman-singh-1990.toml", None)],
)
def test_forces_that_are_printed_are_the_settled_motions_on_every_surface(machine, forces, request):
    """Those of a proven orbit are the forces after 3,000 more cycles, unlike those of the run that led to it.

    Two masses between equal stops have two orbits, mirror images; rounding decides which is reached.
    """
    path = request.getfixturevalue(machine) if machine == "two_masses" else machine
    told = json.loads(CliRunner().invoke(app, ["diagnose", path, "--json"]).stdout)
    shown = CliRunner().invoke(app, ["diagnose", path]).stdout
    settled = simulate(read_machine(path), told["period"], transient=3000 * told["period"]).peak_force.max(axis=0)
    assert told["status"] == "certified"
    for side, reached in zip(("upper", "lower"), settled, strict=True):
        assert told["surfaces_peak_force_N"][side]["max"] == pytest.approx(reached, rel=1e-6)
        assert f"{side}: {told['surfaces_peak_force_N'][side]['min']:.2f} to {reached:.2f} N" in shown or not reached
        assert f"{told['transient_largest_peak_force_N'][side]:.2f} N {side}" in shown.partition("transient")[2]
    assert told["peak_force_summary_N"]["max"] == pytest.approx(settled.max(), rel=1e-6)
    assert told["worst_surface"] == ("upper", "lower")[int(settled.argmax())]
    if forces is not None:
        assert sorted(settled.tolist()) == pytest.approx(forces, rel=1e-5)
        assert max(told["transient_largest_peak_force_N"].values()) > 90.0


def test_diagnose_can_check_the_step():
    """A finer step keeps the verdict of the exact integrator."""
    result = run_json("tradeoff", "impact-beam", "--frequency-hz", "19", "--step-check")
    assert result["step_check"]["nature_stays"] is True
    assert result["step_check"]["period_stays"] is True


def test_classify_answers_with_probabilities():
    """A type, and three probabilities that sum to one; 30 Hz at +-0.127 mm is Type III in the thesis."""
    result = run_json("classify", "impact-beam", "--frequency-hz", "30", "--clearance-mm", "0.127")
    assert set(result["type_probabilities"]) == {"I", "II", "III"}
    assert sum(result["type_probabilities"].values()) == pytest.approx(1.0)
    assert result["response_type"] == "III"


def test_show_prints_every_field_and_its_provenance():
    """All fields in SI, natural frequencies, and where each number comes from; a changed one is "given"."""
    result = run_json("show", "impact-beam", "--clearance-mm", "0.1", "--set", "n_modes=3", "--set", "fitted_modes=0")
    assert set(result["parameters"]) == set(parameters_of(ImpactBeam)) == set(result["provenance"])
    assert result["parameters"]["clearance"] == pytest.approx(1e-4)
    assert len(result["natural_frequencies_hz"]) == 3
    assert result["provenance"]["clearance"]["grade"] == "given"
    assert result["provenance"]["contact_stiffness"]["grade"] == "printed"


def test_sweep_writes_parquet_and_resumes(tmp_path):
    """A sweep fills its folder; the same command again is done at once; another one leaves it alone."""
    command = (
        "sweep",
        "impact-beam",
        "--axis",
        "excitation_frequency=22:30:3",
        "--axis",
        "clearance=1e-4:1.3e-4:2",
        "--budget",
        "100",
        "--out",
        str(tmp_path / "s"),
    )
    first = run_json(*command)
    assert first["points"] == 6
    assert sum(first["nature"].values()) == 6
    held = (tmp_path / "s" / "sweep.parquet").read_bytes()
    assert run_json(*command) == first
    code, _, err = run(*command, "--label", "initial-states=16")
    assert code == 2
    assert "another sweep" in err
    assert (tmp_path / "s" / "sweep.parquet").read_bytes() == held


def test_info_and_version():
    """Version and packages for a bug report."""
    assert run("--version")[1].startswith("chaosgym, version ")
    assert run_json("info")["packages"]["numba"]


SIMULATE = ("simulate", "impact-beam")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((*SIMULATE, "--clearance-mm", "-1"), "--clearance-mm = -1 is out of range; allowed: 0 to 1000 mm"),
        ((*SIMULATE, "--frequency-hz", "0"), "--frequency-hz = 0 is out of range; allowed: 0.001 to 10000 Hz"),
        ((*SIMULATE, "--frequency-hz", "nan"), "--frequency-hz = 'nan Hz' is no finite number"),
        ((*SIMULATE, "--frequency-hz", "fast"), "'fast' is no number"),
        ((*SIMULATE, "--set", "lenth=1"), "did you mean length?"),
        ((*SIMULATE, "--set", "length=-1"), "length = -1 m is out of range; allowed: 0.01 to 10 m"),
        ((*SIMULATE, "--set", "length"), "not of the form FIELD=VALUE"),
        ((*SIMULATE, "--clearance-mm", "1", "--set", "clearance=1"), "given twice"),
        ((*SIMULATE, "--cycles", "0"), "0 is not in the range"),
        ((*SIMULATE, "--cycles", "1e3"), "'1e3' is no whole number; write 1000."),
        ((*SIMULATE, "--cycles", "many"), "'many' is no whole number; write digits alone, up to 10000000."),
        ((*SIMULATE, "--frequncy-hz", "3"), "simulate has no option --frequncy-hz; did you mean --frequency-hz?"),
        (("design", __file__), "is no brief, which is a TOML file; a recording is judged by `chaosgym judge"),
        (("design", "--template", "impact-beam", "--frequncy-hz", "3"), "allowed: --template, --beside"),
        (("new-machine", "part.toml"), "part.toml is no template; use --out part.toml for the file to write"),
        (("new-machine", "--out", "nowhere/own.toml"), "nowhere is no folder; make it first"),
        (("simulate", "steam-engine"), "'steam-engine' is not"),
        (("classify", "impact-beam", "--model", "nowhere.npz"), "'nowhere.npz' does not exist"),
        (("classify", "impact-beam", "--model", __file__), "can't be read as a classifier"),
        (("sweep", "impact-beam", "--axis", "clearance=2:1:3", "--out", "o"), "empty or reversed"),
        (("sweep", "impact-beam", "--sampling", "random", "--out", "o"), "allowed: grid|random:N"),
        (("train-classifier", "--data", "nowhere", "--out", "x"), "'nowhere' does not exist"),
    ],
)
def test_bad_input_ends_in_one_line_and_exit_code_2(arguments, message, tmp_path, monkeypatch):
    """No traceback, nothing on standard output, nothing written."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_other_things_in_it_is_left_alone(tmp_path):
    """Sweep and demo refuse a folder that is not theirs."""
    (tmp_path / "thesis.txt").write_text("mine")
    for command in (("sweep", "impact-beam"), ("demo",)):
        code, _, err = run(*command, "--out", str(tmp_path))
        assert code == 2
        assert "choose another folder" in err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("options", [("--types",), ("--types", "--sensor-error", "3")])
def test_one_command_gives_one_answer(options):
    """The type rests on the very verdict that is printed, with its budget and its sensor error."""
    point = ("--frequency-hz", "16.411929633605986", "--set", "clearance=0.00010630650223074161", "--budget", "100")
    found = run_json("diagnose", "impact-beam", *point, *options)
    assert (found["response_type_reason"] == "the nominal response is chaotic") == (found["nature"] == "chaotic")
    assert (found["response_type"] == "undetermined") == (found["nature"] == "undetermined")


def test_the_step_check_compares_with_the_verdict_that_is_printed():
    """Whether the nature stays is told of the nature that stands beside it."""
    point = ("--frequency-hz", "16.411929633605986", "--set", "clearance=0.00010630650223074161")
    found = run_json("tradeoff", "impact-beam", *point, "--step-check")
    assert found["step_check"]["nature_stays"] == (found["step_check"]["finer_nature"] == found["nature"])


def test_diagnose_offers_the_two_step_test_alone():
    """At 30 Hz, +-0.127 mm both steps end in chaos, on a section with structure; no exponent is asked (5.2.1)."""
    found = run_json("diagnose", "impact-beam", "--test", "two-step", "--budget", "400")
    assert (found["nature"], found["evidence"]["section"]) == ("chaotic", "set with structure")
    assert found["votes"] == {}
    assert found["evidence"]["cycles"] == 400


def test_the_speed_of_an_own_machine_is_stated_in_hertz_or_in_turns(tmp_path):
    """900 rpm are 15 Hz of a file of modes, 5 Hz are 300 rpm of a mechanism; both at once are refused in one line."""
    path = str(tmp_path / "own.toml")
    assert run("new-machine", "--out", path)[0] == 0
    speeds = [
        run_json("show", path, *at)["parameters"]["speed"] for at in (("--speed-rpm", "900"), ("--speed-hz", "15"))
    ]
    assert speeds == [pytest.approx(15.0)] * 2
    yoke = run_json("show", "docs/machines/scotch-yoke.toml", "--speed-hz", "5")
    assert yoke["parameters"]["speed"] == pytest.approx(300.0)
    code, _, err = run("show", path, "--speed-rpm", "900", "--speed-hz", "15")
    assert code == 2
    assert "--speed-hz and --speed-rpm both set speed" in err


def test_diagnose_prints_each_sign_of_chaos_in_one_line():
    """Criteria (5.3.1) and precursors (5.3.2) stand below the verdict; one that is not there with its recall."""
    point = ("diagnose", "impact-beam", "--frequency-hz", "12")
    code, out, err = run(*point)
    assert code == 0, err
    told = [line for line in out.splitlines() if " of chaos" in line]
    assert [line.partition(":")[0].strip() for line in told] == [
        "thresholds of chaos",
        "sign of chaos, period doubling",
        "sign of chaos, period three",
        "sign of chaos, long bouncing",
    ]
    assert all(re.search(r"\d% of the dataset's points with chaos.* had this sign$", line) for line in told)
    assert [sign["present"] for sign in run_json(*point)["signs_of_chaos"]] == [False] * 4


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("diagnos", "impact-beam"), "there is no command diagnos; did you mean diagnose?"),
        (("dataset", "inf", "x"), "there is no command inf; did you mean info?"),
        (("diagnose", "impact-bem"), "did you mean impact-beam?"),
    ],
)
def test_a_slip_of_the_keys_is_answered_by_what_was_meant(words, meant):
    """Commands, their parts, and machines."""
    code, _, err = run(*words)
    assert code == 2
    assert meant in err
    assert err.count("\n") == 1


def test_a_command_like_no_other_lists_them_all():
    """Nothing near is not guessed."""
    code, _, err = run("zzz")
    assert code == 2
    assert "allowed: simulate, show" in err


@pytest.mark.parametrize("command", ["diagnose", "classify"])
def test_a_recording_in_the_place_of_a_machine_is_told_where_it_belongs(tmp_path, command):
    """A file that is no machine's: one line names the command for it."""
    (tmp_path / "peaks.csv").write_text("force [N]\n1\n2\n")
    code, _, err = run(command, str(tmp_path / "peaks.csv"))
    assert code == 2
    assert err.rstrip().endswith(f"a recording is judged by: chaosgym judge {tmp_path / 'peaks.csv'}")
    assert err.count("\n") == 1
