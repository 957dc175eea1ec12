"""A machine as an FMU: stepped by FMPy, it moves as ``simulate`` moves it, to the last digit."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from fmpy.validation import validate_fmu

import chaosgym
from chaosgym.errors import ParameterError
from chaosgym.machines import MACHINES
from chaosgym.simulation.fmu import export_fmu
from tests.cli.run import run, run_json
from tests.simulation.fmu_player import Player

MACHINE_FILES = Path(__file__).parents[2] / "docs" / "machines"
SAMPLES = 64

SCENES = {
    "impact-beam": {"excitation_frequency": 24.0},
    "slider-crank": {"crank_speed": 200.0},
    f"{MACHINE_FILES}/shaw-holmes-1983.toml": {},
    f"{MACHINE_FILES}/cam-follower.toml": {},
    f"{MACHINE_FILES}/quick-return.toml": {},
}
"""Beam, crank, one stop, a file beside the file, and a mechanism of several joints."""


def player_of(machine, folder):
    """An FMU of a machine, initialised."""
    folder.mkdir(exist_ok=True)
    return Player(export_fmu(machine, folder / "machine.fmu", samples=SAMPLES), folder / "unpacked")


@pytest.mark.parametrize("name", SCENES)
def test_an_fmu_moves_as_simulate_does(name, tmp_path):
    """Peak forces, impacts, motion and force at quarters of a cycle equal the record of whole cycles bit for bit."""
    machine = MACHINES[name](**SCENES[name])
    player, cycles = player_of(machine, tmp_path), 12
    record = chaosgym.simulate(machine, cycles, samples_per_cycle=SAMPLES)
    every = record.history if record.histories is None else record.histories
    joints = [f"{joint}_" for joint in machine.joints] or [""]
    motion = [f"{joint}{what}" for joint in joints for what in ("displacement", "velocity", "force")]
    for cycle in range(cycles):
        for quarter in range(4):
            assert player.get(*motion) == every[cycle, quarter * SAMPLES // 4].tolist()
            player.step(machine.cycle_period / 4.0)
        for side, place in machine.surfaces.items():
            told = player.get(f"peak_force_{side.replace(' ', '_')}", f"impacts_{side.replace(' ', '_')}")
            assert told == [record.peak_force[cycle, place], record.impacts[cycle, place]]
    assert player.get("cycles") == [cycles]
    assert record.peak_force.max() > 0.0


def test_speed_and_load_change_when_a_cycle_begins(tmp_path):
    """Inputs that are set within a cycle act from the next one on, as ``operation`` of ``simulate`` says."""
    machine = chaosgym.ImpactBeam(excitation_frequency=20.0)
    player = player_of(machine, tmp_path)
    speed = np.repeat([20.0, 21.0, 19.5], 5)
    load = np.repeat([machine.force_amplitude, 0.8 * machine.force_amplitude, machine.force_amplitude], 5)
    record = chaosgym.simulate(machine, 15, operation={"excitation_frequency": speed, "force_amplitude": load})
    for cycle in range(15):
        player.step(0.5 / speed[cycle])
        if cycle < 14:
            player.set(speed=speed[cycle + 1], force_amplitude=load[cycle + 1])
        assert player.get("cycle_speed") == [speed[cycle]]
        player.step(0.5 / speed[cycle])
        assert player.get("peak_force_upper", "peak_force_lower") == record.peak_force[cycle].tolist()


def test_one_long_step_is_many_short_ones(tmp_path):
    """Thirty cycles in one step, and in steps of a tenth of a cycle, end at the same instant of the same cycle."""
    machine = chaosgym.ImpactBeam(excitation_frequency=23.25)
    whole, parts = (player_of(machine, tmp_path / name) for name in ("whole", "parts"))
    whole.step(30.5 * machine.cycle_period)
    for _ in range(305):
        parts.step(0.1 * machine.cycle_period)
    names = ("peak_force_upper", "displacement", "cycles")
    assert whole.get(*names) == parts.get(*names)


def test_the_verdict_is_that_of_the_two_step_test(tmp_path):
    """Period 2 at 23.25 Hz; a new speed begins a new record, of which too few cycles tell nothing."""
    machine = chaosgym.ImpactBeam(excitation_frequency=23.25)
    player = player_of(machine, tmp_path)
    assert player.get("nature", "verdict_period", "verdict_margin") == [0, 0, 0.0]
    player.step(300 * machine.cycle_period)
    told = chaosgym.two_step_test(chaosgym.simulate(machine, 300))
    assert told.period == 2
    assert player.get("nature", "verdict_period", "verdict_margin") == [1, told.period, told.margin]
    player.set(speed=20.0)
    player.step(4.0 / 20.0)
    assert player.get("nature", "cycle_speed") == [0, 20.0]


def test_the_description_is_valid(tmp_path):
    """FMPy's checks of the schema and of what the standard asks of variables find nothing."""
    path = export_fmu(MACHINES[f"{MACHINE_FILES}/quick-return.toml"](), tmp_path / "quick-return.fmu")
    assert validate_fmu(str(path)) == []


def test_an_input_out_of_range_fails_the_step(tmp_path, capfd):
    """With the reason in one line; a step at an allowed speed goes on."""
    player = player_of(chaosgym.ImpactBeam(excitation_frequency=20.0), tmp_path)
    player.set(speed=-3.0)
    with pytest.raises(Exception, match="discard"):
        player.step(0.05)
    assert "excitation_frequency = -3 Hz is out of range" in capfd.readouterr().err
    player.set(speed=20.0)
    player.step(0.05)
    assert player.get("cycles") == [1]


def test_an_fmu_needs_none_of_the_files_it_was_made_from(tmp_path):
    """The machine's file and the CSV that it names go along."""
    for name in ("cam-follower.toml", "cam-follower.csv"):
        shutil.copy(MACHINE_FILES / name, tmp_path / name)
    machine = chaosgym.read_machine(tmp_path / "cam-follower.toml")
    force = chaosgym.simulate(machine, 1).peak_force[0, 0]
    path = export_fmu(machine, tmp_path / "cam.fmu")
    for name in ("cam-follower.toml", "cam-follower.csv"):
        (tmp_path / name).unlink()
    player = Player(path, tmp_path / "unpacked")
    player.step(machine.cycle_period)
    assert player.get("peak_force_upper") == [force]


def test_the_command_says_what_the_fmu_has(tmp_path):
    """Inputs and outputs; a wrong ending, a file that is there, and no samples end in one line."""
    path = tmp_path / "beam.fmu"
    told = run_json("export", "impact-beam", "--frequency-hz", "19", "--fmu", path)
    assert set(told["inputs"]) == {"speed", "clearance", "force_amplitude"}
    assert {"peak_force_upper", "displacement", "nature"} <= set(told["outputs"])
    code, _, err = run("export", "impact-beam", "--fmu", path)
    assert (code, len(err.splitlines())) == (2, 1)
    assert "exists" in err
    assert "allowed: .fmu" in run("export", "impact-beam", "--fmu", tmp_path / "beam.zip")[2]
    with pytest.raises(ParameterError, match="samples = 0 is out of range"):
        export_fmu(chaosgym.ImpactBeam(), path, samples=0)


def test_a_file_of_another_folder_is_refused(tmp_path):
    """The FMU takes along what lies beside the machine's file alone."""
    (tmp_path / "inner").mkdir()
    shutil.copy(MACHINE_FILES / "cam-follower.csv", tmp_path)
    text = (MACHINE_FILES / "cam-follower.toml").read_text("utf-8").replace("cam-follower.csv", "../cam-follower.csv")
    (tmp_path / "inner" / "cam.toml").write_text(text, encoding="utf-8")
    machine = chaosgym.read_machine(tmp_path / "inner" / "cam.toml")
    with pytest.raises(ParameterError, match="lies outside its folder"):
        export_fmu(machine, tmp_path / "cam.fmu")


def test_a_program_that_is_no_python_runs_it(tmp_path):
    """A C program, with the library of a Python loaded before: the digits of ``simulate``."""
    library = Path(sysconfig.get_config_var("LIBDIR") or "") / str(sysconfig.get_config_var("LDLIBRARY"))
    if shutil.which("gcc") is None or library.suffix != ".so" or not library.exists():
        pytest.skip("no gcc, or no shared library of Python")
    machine = chaosgym.ImpactBeam(excitation_frequency=20.0)
    player = player_of(machine, tmp_path)
    host = tmp_path / "host"
    subprocess.run(["gcc", "-w", "-o", host, Path(__file__).with_name("host.c"), "-ldl"], check=True)
    folder, about = tmp_path / "unpacked", player.about
    binary = next(folder.glob(f"binaries/linux64/{about.coSimulation.modelIdentifier}.so"))
    reference = player.variables["peak_force_upper"].valueReference
    done = subprocess.run(
        [host, binary, about.guid, (folder / "resources").as_uri(), str(reference), repr(machine.cycle_period)],
        env={**os.environ, "LD_PRELOAD": str(library), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    told = [float(line) for line in done.stdout.split()]
    assert told == chaosgym.simulate(machine, 10).peak_force[:, 0].tolist()
