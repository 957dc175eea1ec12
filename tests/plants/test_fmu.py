"""FMUs of others as plants: a rig of C, examples of pythonfmu and pythonfmu3, and bad ones, each told in one line."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from chaosgym.errors import ParameterError
from chaosgym.plants.fmu import FmuPlant, described
from chaosgym.simulation.fmu import export_fmu
from docs.examples.rig import Rig
from tests.cli.run import run, run_json
from tests.plants.made import description, example_fmu, rig_fmu, zipped

BEAM = "chaosgym/ImpactBeamTolerance-v1"
PORTS = {"input": "speed", "output": "force"}


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """The rig of C."""
    return rig_fmu(tmp_path_factory.mktemp("rig"))


@pytest.fixture
def plants():
    """Plants of an FMU, which are closed after the test."""
    made = []

    def make(path, **given):
        made.append(FmuPlant(path, **PORTS | given))
        return made[-1]

    yield make
    for plant in made:
        plant.close()


def test_an_fmu_of_c_is_the_rig_of_python(rig, plants):
    """The same scheme in two languages: largest forces on the upper stop, before chaos has magnified the rounding."""
    plant, twin = plants(rig, samples=400), Rig()
    plant.reset()
    twin.reset()
    for speed in (12.0, 13.5):
        peaks = np.array(plant.run(speed, 4)["peaks"])
        np.testing.assert_allclose(peaks[:, 0], twin.run(speed, 4), rtol=1e-6)
    assert peaks[:, 0].min() > 0.0
    assert peaks[:, 1].max() < 0.0


def test_a_reset_begins_anew(rig, plants):
    """The same first cycles, whatever ran before; also after a stop, and after the process was closed."""
    plant = plants(rig)
    plant.reset()
    first = plant.run(13.0, 5)
    for end in (lambda: None, plant.stop, plant.close):
        end()
        plant.reset()
        assert plant.run(13.0, 5) == first
    assert plant.run(13.0, 5) != first


def test_ctrl_c_leaves_no_answer_behind(rig, plants, monkeypatch):
    """Its process ends, so that the next job is not told the forces of this one; stop() is then no error."""
    plant, twin = plants(rig), plants(rig)
    for each in (plant, twin):
        each.reset()
    answers = plant._answers

    def pressed():
        raise KeyboardInterrupt

    monkeypatch.setattr(answers, "next", pressed)
    with pytest.raises(KeyboardInterrupt):
        plant.run(13.0, 50)
    plant.stop()
    plant.reset()
    assert plant.run(15.0, 5) == twin.run(15.0, 5)


def test_a_crash_in_between_is_no_error_of_the_next_job(rig, plants):
    """A process that was killed between two jobs is begun anew."""
    plant = plants(rig)
    plant.reset()
    first = plant.run(13.0, 3)
    plant._process.kill()
    plant._process.wait()
    plant.reset()
    assert plant.run(13.0, 3) == first


def test_two_outputs_are_two_stops(rig, plants):
    """The force on each, or one force with its sign, give the same pairs."""
    signed, each = plants(rig), plants(rig, output=["upper", "lower"])
    for plant in (signed, each):
        plant.reset()
    assert signed.run(13.0, 8) == each.run(13.0, 8)


def test_a_speed_is_measured_in_the_unit_of_the_set_one(rig, plants):
    """A drive that tops out at 10 Hz: 600 rpm are told, whatever is set, and it turns at these."""
    plant = plants(rig, unit="rpm", measured="ran", start={"top": 10.0})
    plant.reset()
    assert plant.run(540.0, 2)["speed"] == pytest.approx(540.0)
    assert plant.run(780.0, 2)["speed"] == pytest.approx(600.0)


@pytest.mark.parametrize(
    ("unit", "factor"), [("Hz", 1.0), ("rpm", 60.0), ("rad/s", 2.0 * np.pi), ("deg/s", 360.0), ("1/min", 60.0)]
)
def test_the_input_has_its_own_unit(unit, factor, rig, plants, tmp_path):
    """What is sent is the set speed in the unit that the FMU declares, or in that which is given."""
    changed = zipped(
        tmp_path / "rig.fmu", description(**{'name="Hz"': f'name="{unit}"', 'unit="Hz"': f'unit="{unit}"'})
    )
    members = subprocess.run(["unzip", "-q", rig, "binaries/*", "-d", tmp_path], check=False)
    if members.returncode:
        pytest.skip("no unzip")
    subprocess.run(["zip", "-qr", changed, "binaries"], cwd=tmp_path, check=True)
    for path, given in ((changed, {}), (rig, {"input_unit": unit})):
        plant = plants(path, measured="ran", **given)
        plant.reset()
        sent = plant._ask("run", [7.0 * factor, 1.0 / 7.0, 1, 1e-2])["speed"]
        assert sent == pytest.approx(7.0 * factor)
        assert plant.run(7.0, 1)["speed"] == pytest.approx(7.0)


def test_steps_of_one_length_make_cycles_of_any(rig, plants):
    """Steps of 1 ms at 13 Hz: a cycle ends at the nearest one, and a thousand of them at the same time."""
    by_time, by_cycle = plants(rig, step=1e-3), plants(rig, samples=77)
    for plant in (by_time, by_cycle):
        plant.reset()
    peaks = [np.array(plant.run(13.0, 200)["peaks"]) for plant in (by_time, by_cycle)]
    assert abs(peaks[0][100:, 0].mean() / peaks[1][100:, 0].mean() - 1.0) < 0.1


@pytest.mark.parametrize("library", ["pythonfmu", "pythonfmu3"])
def test_examples_of_others_run(library, plants, tmp_path):
    """FMI 2.0 and 3.0; this example's output is the time, so its largest value in a cycle is the cycle's end."""
    pytest.importorskip(library)
    path = example_fmu(library, "pythonslave.py", tmp_path)
    plant = plants(path, input="realIn", output="realOut", input_unit="Hz")
    plant.reset()
    told = np.array(plant.run(4.0, 6)["peaks"])
    np.testing.assert_allclose(told[:, 0], np.arange(1, 7) / 4.0, rtol=1e-9)


@pytest.fixture(scope="module", params=["2", "3"])
def reference(request, tmp_path_factory):
    """An FMU of the Modelica Association in a version of FMI, built from source where that and a compiler are."""
    source = os.environ.get("REFERENCE_FMUS")
    if source is None or shutil.which("cmake") is None:
        pytest.skip("no cmake, or REFERENCE_FMUS names no clone of github.com/modelica/Reference-FMUs")
    built = tmp_path_factory.mktemp("reference")
    made = ["cmake", "-S", source, "-B", built, f"-DFMI_VERSION={request.param}", "-DWITH_FMUSIM=OFF"]
    for words in (made, ["cmake", "--build", built, "--target", "Feedthrough"]):
        subprocess.run(words, check=True, capture_output=True)
    return built / "fmus" / "Feedthrough.fmu"


FEEDTHROUGH = {"input": "Float64_continuous_input", "output": "Float64_continuous_output"}


def test_a_reference_fmu_runs(reference, plants):
    """What goes in comes out."""
    plant = plants(reference, **FEEDTHROUGH)
    plant.reset()
    assert plant.run(12.5, 2)["peaks"] == [[12.5, 0.0]] * 2


def test_a_policy_plays_a_reference_fmu(reference):
    """Its force is the speed, so kriging goes below the demand and wins life, in the command and in a job."""
    words = ("--input", FEEDTHROUGH["input"], "--output", FEEDTHROUGH["output"], "--plant-arg", "samples=5")
    told = run_json("run-agent", BEAM, "--fmu", reference, *words)
    assert told["life"] > 1.1
    np.testing.assert_allclose(told["mean_peak_force_N"], told["speed"])


def test_our_own_fmu_gives_the_peaks_of_simulate(plants, tmp_path):
    """The largest force of a cycle, which the FMU tells, is that of the record; contacts at the steps come near it."""
    machine = chaosgym.ImpactBeam(excitation_frequency=20.0)
    path = export_fmu(machine, tmp_path / "beam.fmu", samples=4096)
    plant = plants(path, output=["peak_force_upper", "peak_force_lower"], samples=1)
    plant.reset()
    record = chaosgym.simulate(machine, 15)
    told = np.abs(plant.run(20.0, 15)["peaks"])
    np.testing.assert_array_equal(told, record.peak_force)
    plant = plants(path, samples=4096)
    plant.reset()
    told = plant.run(20.0, 15)
    np.testing.assert_allclose(np.abs(told["peaks"]), record.peak_force, rtol=1e-2)
    assert told["impacts"] == pytest.approx(record.impacts.sum() / 15, rel=0.05)
    assert told["bouncing"] == pytest.approx(record.bounce_duration.sum() * 20.0 / 15, rel=0.05)


def test_a_unit_of_our_own_fmu_is_heeded(plants, tmp_path):
    """A crank's speed is in rpm: a plant that is asked for 4 turns a second runs it at 240 rpm, cycle by cycle."""
    machine = chaosgym.SliderCrank(crank_speed=240.0, fidelity="draft")
    path = export_fmu(machine, tmp_path / "crank.fmu", samples=1)
    forces = ["peak_force_upper", "peak_force_lower"]
    plant = plants(path, output=forces, samples=1, unit="Hz", measured="cycle_speed")
    plant.reset()
    told = plant.run(4.0, 6)
    np.testing.assert_array_equal(np.abs(told["peaks"]), chaosgym.simulate(machine, 6).peak_force)
    assert told["speed"] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("given", "speed", "complaint"),
    [({}, 0.0, "speed = 0.0 is out of range"), ({"step": 0.1}, 13.0, "step = 0.1 s is too long for a cycle of 0.0769")],
)
def test_a_cycle_without_a_step_is_refused(given, speed, complaint, rig, plants):
    """Else its force would be told as none."""
    plant = plants(rig, **given)
    plant.reset()
    with pytest.raises(ParameterError, match=complaint):
        plant.run(speed, 5)


BAD = {
    "no file": (lambda folder, rig: folder / "gone.fmu", "can't be read: No such file"),
    "no archive": (lambda folder, rig: text_file(folder), "is no FMU: File is not a zip file"),
    "no description": (lambda folder, rig: empty(folder), "is no FMU that FMPy can read"),
    "no XML": (lambda folder, rig: zipped(folder / "a.fmu", "<fmi"), "is no FMU that FMPy can read"),
    "FMI 1.0": (lambda folder, rig: zipped(folder / "a.fmu", ONE), "is of FMI 1.0; allowed: 2.0, 3.0"),
    "FMI 9.0": (lambda folder, rig: zipped(folder / "a.fmu", description(**{'Version="2.0"': 'Version="9.0"'})), "9.0"),
    "model exchange": (
        lambda folder, rig: zipped(folder / "a.fmu", description(CoSimulation="ModelExchange", **VARIABLE_STEP)),
        "for model exchange alone; allowed: one for co-simulation",
    ),
    "another computer": (
        lambda folder, rig: zipped(folder / "a.fmu", description(), {"binaries/amiga/Rig.so": b""}),
        "has binaries for amiga; allowed: ",
    ),
    "a bomb": (
        lambda folder, rig: zipped(folder / "a.fmu", description(), {"resources/zeros": b"\0" * 2_000_000}),
        "bytes in 2 files, unpacked; allowed: up to 1000000 in",
    ),
    "no library": (
        lambda folder, rig: zipped(folder / "a.fmu", description(), {library_name(): b"nonsense"}),
        "Failed to load shared library",
    ),
    "no such input": ({"input": "sped"}, "'sped' is no variable of .*did you mean speed"),
    "no such output": (
        {"output": "noise"},
        "'noise' is no variable of .*its outputs: force, upper, lower, ran",
    ),
    "an output as input": ({"input": "force"}, "input = 'force' is continuous output; allowed: an input"),
    "a number as output": ({"output": "trouble"}, "output = 'trouble' is of type Integer; allowed: one real number"),
    "three outputs": ({"output": ["force"] * 3}, "allowed: one variable, or two, of two stops"),
    "no such start": ({"start": {"mass": 1.0}}, "start has 'mass', which is no variable of"),
    "text as a start": (
        {"start": {"top": "fast"}},
        r"\['top'\] = 'fast' is not usable; the variable is of type Real",
    ),
    "no unit": ({"input_unit": "knots"}, "input_unit = 'knots' is not one of Hz"),
    "no samples": ({"samples": 0}, "samples = 0 is out of range; allowed: whole numbers from 1"),
    "no step": ({"step": -1.0}, "step = -1 s is out of range"),
    "a step that fails": (
        {"start": {"trouble": 1}},
        r"step at t = 1 s failed: fmi2DoStep failed with status 3",
    ),
    "a crash": ({"start": {"trouble": 2}}, r"ended its process \(signal 6\)"),
    "no end": ({"start": {"trouble": 3}, "seconds": 1.0}, "gave no answer within 1 s, and was ended"),
}
VARIABLE_STEP = {' canHandleVariableCommunicationStepSize="true"': ""}
ONE = (
    '<fmiModelDescription fmiVersion="1.0" modelName="a" modelIdentifier="a" guid="a" numberOfContinuousStates="0" '
    'numberOfEventIndicators="0"/>'
)


def library_name():
    """Where the binary of the rig for this computer lies."""
    import fmpy

    return f"binaries/{fmpy.platform}/Rig{fmpy.sharedLibraryExtension}"


def text_file(folder):
    """A file that is no archive."""
    (folder / "a.fmu").write_text("no archive")
    return folder / "a.fmu"


def empty(folder):
    """An archive without a description."""
    with zipfile.ZipFile(folder / "a.fmu", "w") as archive:
        archive.writestr("other.xml", "<a/>")
    return folder / "a.fmu"


@pytest.mark.parametrize("case", BAD)
def test_a_bad_fmu_is_told_in_one_line(case, rig, plants, tmp_path, monkeypatch):
    """Whatever is wrong with it, and when that shows: the file, and what is wrong."""
    monkeypatch.setattr("chaosgym.plants.fmu.LARGEST", 1_000_000)
    what, complaint = BAD[case]
    path, given = (rig, what) if isinstance(what, dict) else (what(tmp_path, rig), {})

    def play():
        plant = plants(path, **given)
        plant.reset()
        plant.run(13.0, 20)

    with pytest.raises(ParameterError, match=complaint) as told:
        play()
    assert "\n" not in str(told.value)
    assert len(str(told.value)) < 500


def test_an_archive_may_have_as_much_as_is_allowed_and_no_more(rig, monkeypatch):
    """Bytes and files at the limit are read; a byte or a file beyond it is refused."""
    with zipfile.ZipFile(rig) as archive:
        size, files = sum(one.file_size for one in archive.infolist()), len(archive.infolist())
    for name, value in (("LARGEST", size), ("MOST", files)):
        monkeypatch.setattr(f"chaosgym.plants.fmu.{name}", value)
        assert described(rig).fmiVersion == "2.0"
        with monkeypatch.context() as tight:
            tight.setattr(f"chaosgym.plants.fmu.{name}", value - 1)
            with pytest.raises(ParameterError, match="unpacked; allowed: up to"):
                described(rig)


def test_the_last_line_that_an_fmu_printed_is_told(rig, tmp_path):
    """Of several lines the last that says something."""
    plant = FmuPlant(rig, **PORTS)
    plant._folder = tmp_path
    (tmp_path / "printed.txt").write_text("a start\nno licence\n\n")
    assert plant._last_words() == "; it printed: no licence"


def test_a_step_that_an_fmu_can_not_take_is_refused(rig, plants, tmp_path):
    """An FMU of one length of step needs that length."""
    path = zipped(tmp_path / "a.fmu", description(**VARIABLE_STEP), {library_name(): b""})
    with pytest.raises(ParameterError, match=r"takes steps of one length alone.*give step=\.\.\. \[s\]"):
        plants(path)
    plants(path, step=1e-3)


def test_what_an_fmu_prints_is_no_answer(rig, plants):
    """A line on standard output that looks like an answer goes elsewhere; the peaks are those of a quiet one."""
    loud, quiet = plants(rig, start={"trouble": 4}), plants(rig)
    for plant in (loud, quiet):
        plant.reset()
    assert loud.run(13.0, 20) == quiet.run(13.0, 20)


def test_nothing_of_an_fmu_is_run_before_a_reset(rig, tmp_path):
    """To read its description loads no library: one that can't be loaded is described like any other."""
    plant = FmuPlant(zipped(tmp_path / "a.fmu", description(), {library_name(): b"nonsense"}), **PORTS)
    assert plant.tool == "gcc"
    assert "runs here with your rights" in plant.warning
    with pytest.raises(ParameterError, match="call reset"):
        plant.run(13.0, 5)


def test_nothing_is_left_behind(rig):
    """Neither a process nor a folder, once the plant is gone."""
    code = (
        "import sys; from chaosgym.plants.fmu import FmuPlant\n"
        "p = FmuPlant(sys.argv[1], input='speed', output='force'); p.reset(); p.run(13.0, 2)\n"
        "print(p._process.pid, p._folder)"
    )
    done = subprocess.run([sys.executable, "-c", code, rig], capture_output=True, text=True, check=True)
    number, folder = done.stdout.split()
    assert done.stderr == ""
    assert not Path(folder).exists()
    with pytest.raises(ProcessLookupError):
        os.kill(int(number), 0)


def test_the_command_plays_an_fmu(rig):
    """Kriging beside following the demand, as at any plant; what is loaded is said first, on standard error."""
    words = ("run-agent", BEAM, "--fmu", rig, "--input", "speed", "--output", "force", "--plant-arg", "measured=ran")
    words += ("--plant-arg", "samples=40")
    code, out, err = run(*words, "--plant-arg", 'start={"top": 21.0}')
    assert code == 0, err
    assert err.startswith(f"note: {rig} is a program by gcc; it runs here with your rights")
    assert "Kriging: " in out
    assert "the drive did not reach the speed that was set" in out
    told = run_json(*words)
    assert len(told["measured_speed"]) == 120
    assert told["life"] == pytest.approx(told["follow"]["damage"] / told["damage"])


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--fmu", "RIG"), "--fmu needs --input NAME, its speed, and --output NAME"),
        (("--input", "speed"), "--input and --output are of an FMU; give --fmu FILE too"),
        (("--fmu", "RIG", *("--plant", "rig:Rig")), "--plant and --fmu exclude each other"),
        (("--fmu", "RIG", "--input", "speed", "--output", "force", "--level", "wear"), "leave it out with --fmu"),
        (("--fmu", "RIG", "--input", "speed", "--output", "force", "--plant-arg", "gain=2"), "'gain'"),
        (("--fmu", "RIG", "--input", "sped", "--output", "force"), "did you mean speed?"),
    ],
)
def test_a_wrong_use_of_the_command_is_one_line(words, complaint, rig):
    """It names the option."""
    code, out, err = run("run-agent", BEAM, *(rig if word == "RIG" else word for word in words))
    assert (code, out) == (2, "")
    assert complaint in err
    assert "Traceback" not in err


def test_a_crash_in_a_job_keeps_its_steps(rig):
    """Exit code 2, the steps before it, and the line that says what happened."""
    words = ("run-agent", BEAM, "--fmu", rig, "--input", "speed", "--output", "force", "--json")
    code, _, err = run(*words, "--plant-arg", 'start={"trouble": 2}')
    assert code == 2
    assert "ended its process (signal 6)" in err
    assert "(the run-in)" in err or "steps of the job Kriging were played" in err


def test_without_the_extra_the_missing_library_is_named():
    """A Python without FMPy and pythonfmu: one line, with what to install, from both commands."""
    hide = (
        "import sys, importlib.util as util; real = util.find_spec\n"
        "hidden = ('fmpy', 'pythonfmu')\n"
        "util.find_spec = lambda name, *more: None if name in hidden else real(name, *more)\n"
        "sys.modules.update(dict.fromkeys(hidden))\n"
        "from chaosgym.cli import main; sys.argv[:] = ['chaosgym', *sys.argv[1:]]; main()"
    )
    for words, library in (
        (("export", "impact-beam", "--fmu", "no.fmu"), "pythonfmu"),
        (("run-agent", BEAM, "--fmu", "no.fmu", "--input", "a", "--output", "b"), "FMPy"),
    ):
        done = subprocess.run([sys.executable, "-c", hide, *words], capture_output=True, text=True, check=False)
        assert done.returncode in (1, 2)
        assert f"{library} is not installed; install it with: pip install 'chaosgym[fmu]'" in done.stderr
        assert "Traceback" not in done.stderr
