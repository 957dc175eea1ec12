"""The command line keeps its contract: JSON keys, exit codes, one clear line for bad input."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym import read_machine
from chaosgym.cli import app
from chaosgym.machines import ImpactBeam
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import simulate
from tests.cli.run import run, run_json


def test_simulate_prints_the_peaks_of_simulate():
    """The numbers are those of the library, of the surface with the largest, one a cycle from rest."""
    result = run_json("simulate", "impact-beam", "--frequency-hz", "19", "--clearance-mm", "0.1", "--cycles", "30")
    record = simulate(ImpactBeam(excitation_frequency=19.0, clearance=0.1e-3), 30)
    assert result["peak_force_N"] == record.peak_force[:, record.worst_side].tolist()
    assert result["surfaces_peak_force_N"] == dict(zip(("upper", "lower"), record.peak_force.T.tolist(), strict=True))
    assert result["impacts"] == record.impacts.sum(axis=1).tolist()
    assert 0.0 < result["seconds_per_cycle"] < 1.0


@pytest.mark.parametrize(("frequency", "nature"), [("19", "periodic"), ("30", "chaotic")])
def test_diagnose_tells_the_printed_natures(frequency, nature):
    """At +-0.127 mm the thesis prints periodic at 19 Hz and chaotic at 30 Hz (figures 3.6 and 3.7)."""
    result = run_json("diagnose", "impact-beam", "--frequency-hz", frequency, "--clearance-mm", "0.127")
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
        "excitation_frequency=18:30:3",
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
    code, _, err = run(*command, "--seed", "5")
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
        ((*SIMULATE, "--frequency-hz", "fast"), "'fast' is not a valid float"),
        ((*SIMULATE, "--set", "lenth=1"), "did you mean length?"),
        ((*SIMULATE, "--set", "length=-1"), "length = -1 m is out of range; allowed: 0.01 to 10 m"),
        ((*SIMULATE, "--set", "length"), "not of the form FIELD=VALUE"),
        ((*SIMULATE, "--clearance-mm", "1", "--set", "clearance=1"), "given twice"),
        ((*SIMULATE, "--cycles", "0"), "0 is not in the range"),
        (("simulate", "steam-engine"), "'steam-engine' is not"),
        (("classify", "impact-beam", "--model", "nowhere.npz"), "'nowhere.npz' does not exist"),
        (("classify", "impact-beam", "--model", __file__), "can't be read as a classifier"),
        (("sweep", "impact-beam", "--axis", "clearance=2:1:3", "--out", "o"), "empty or reversed"),
        (("sweep", "impact-beam", "--random", "5", "--sobol", "5", "--out", "o"), "exclude each other"),
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


def test_diagnose_prints_each_sign_of_chaos_in_one_line():
    """Criteria (5.3.1) and precursors (5.3.2) stand below the verdict; one that is not there with its recall."""
    point = ("diagnose", "impact-beam", "--frequency-hz", "12")
    code, out, err = run(*point)
    assert code == 0, err
    told = [line for line in out.splitlines() if "(5.3." in line]
    assert [line.split(" (")[0].strip() for line in told] == [
        "criteria",
        "period doubling",
        "period three",
        "long bouncing",
    ]
    assert all(re.search(r"\d% of the dataset's points with chaos.* had it$", line) for line in told)
    assert [sign["present"] for sign in run_json(*point)["signs_of_chaos"]] == [False] * 4
