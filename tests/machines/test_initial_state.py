"""An initial state that a machine has of its own: by call, in its file and on the command line."""

import json
import pickle

import numpy as np
import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym.cli import app
from chaosgym.diagnosis import attractors
from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import with_settings
from chaosgym.sweeps import Axis, SweepPlan, read_sweep

JUMP = (
    '[structure]\nfrequencies = "1 Hz"\ndamping_ratios = 0.04\n[structure.shapes]\nmass = "1 kg^-1/2"\n'
    '[joint]\nat = "mass"\nclearance = "1 mm"\nstiffness = "197.392 N/m"\ndamping = "0 N s/m"\n'
    '[[drive]]\nat = "mass"\nforce = "15.7914 mN"\n'
    '[operation]\nspeed = "1.5 Hz"\nspeed_range = "0.5 to 3 Hz"\nclearance_range = "0.5 to 3 mm"\n'
)
"""Free flight from rest; a rattle beside it."""


@pytest.fixture
def jump(tmp_path):
    """File of the machine."""
    file = tmp_path / "jump.toml"
    file.write_text(JUMP)
    return file


def told(*words):
    """JSON of a command that must succeed."""
    done = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def test_a_coexisting_motion_is_judged_from_its_state(jump, tmp_path):
    """From the state of the rattle commands are about the rattle: by a file of numbers, and by the machine's file."""
    machine = chaosgym.read_machine(jump)
    rattle = attractors(machine).motions[1]
    state = tmp_path / "state.json"
    state.write_text(json.dumps(rattle.state.tolist()))
    assert max(told("simulate", jump, "--cycles", 5)["peak_force_N"]) == 0.0
    found = told("simulate", jump, "--cycles", 5, "--transient", 100, "--initial-state", state)
    assert found["peak_force_N"] == pytest.approx([rattle.largest_peak] * 5)
    judged = told("diagnose", jump, "--initial-state", state, "--types")
    assert judged["evidence"]["initial_state"] == rattle.state.tolist()
    assert judged["attractors"]["motions"][0]["largest_peak"] == pytest.approx(rattle.largest_peak)
    assert "rest" in judged["attractors"]["motions"][1]["from_starts"]
    stated = tmp_path / "rattle.toml"
    numbers = ", ".join(f"{value!r}" for value in rattle.state.tolist())
    stated.write_text(JUMP + f'initial_state = "{numbers}"\n')
    own = chaosgym.read_machine(stated)
    assert own.initial_state == tuple(rattle.state.tolist())
    assert chaosgym.diagnose(own).evidence["largest_peak"] == pytest.approx(rattle.largest_peak)
    assert told("simulate", stated, "--cycles", 5, "--initial-state", "rest")["peak_force_N"] == [0.0] * 5


def test_a_state_stays_with_its_machine(jump):
    """Through other settings, another speed and a pickle; another random seed is another state."""
    machine = chaosgym.read_machine(jump).from_state([1e-3, 0.0])
    for one in (with_settings(machine, {"speed": 1.4}), machine.at(1.4), pickle.loads(pickle.dumps(machine))):
        assert one.initial_state == (1e-3, 0.0)
        assert chaosgym.simulate(one, 1).section[0].tolist() == [1e-3, 0.0]
    assert machine.from_state(()).initial_state == ()
    peaks = [told("simulate", jump, "--cycles", 3, "--initial-state", f"random:{seed}") for seed in (0, 0, 1)]
    assert peaks[0]["peak_force_N"] == peaks[1]["peak_force_N"] != peaks[2]["peak_force_N"]


@pytest.fixture
def rattling(jump, tmp_path):
    """The rattle of the machine, and a file of its state."""
    rattle = attractors(chaosgym.read_machine(jump)).motions[1]
    state = tmp_path / "state.txt"
    state.write_text(" ".join(f"{value!r}" for value in rattle.state.tolist()))
    return rattle, state


def test_every_point_of_a_sweep_begins_there(jump, rattling, tmp_path):
    """From the state of the rattle the rows are of the rattle; the folder keeps the state and goes on with no other."""
    rattle, state = rattling
    words = ["sweep", jump, "--axis", "speed=1.48:1.52:3", "--label", "full-types=0", "--out", tmp_path / "swept"]
    found = told(*words, "--initial-state", state)
    assert "from its initial state alone" in found["calm"]["searched"]
    sweep = read_sweep(tmp_path / "swept")
    assert sweep.plan.machine.initial_state == tuple(rattle.state.tolist())
    assert sweep.column("largest_peak")[1] == pytest.approx(rattle.largest_peak)
    assert min(sweep.column("largest_peak")) > 0.9 * rattle.largest_peak
    shown = CliRunner().invoke(app, [*map(str, words), "--initial-state", str(state)])
    assert "response_type I 3 (from its initial state)" in shown.output
    assert "Type I from its initial state" in shown.output
    done = CliRunner().invoke(app, [*map(str, words), "--initial-state", "random:1"])
    assert "it differs in initial_state" in str(done.exception)
    from_rest = told(*words[:-1], tmp_path / "rest")
    assert "from rest alone" in from_rest["calm"]["searched"]
    assert "initial_state" not in read_sweep(tmp_path / "rest").settings
    assert max(read_sweep(tmp_path / "rest").column("largest_peak")) == 0.0


def test_a_brief_is_answered_for_the_motion_that_a_state_leads_to(jump, rattling):
    """Forces of the nominal machine and of those in tolerance are the rattle's; from rest there are none."""
    rattle, state = rattling
    short = ["design", jump, "--verdict-only"]
    found, rest = told(*short, "--initial-state", state), told(*short)
    assert found["nominal"]["largest_peak_N"] == pytest.approx(rattle.largest_peak, rel=1e-6)
    assert rest["nominal"]["largest_peak_N"] == 0.0
    shown = CliRunner().invoke(app, [*map(str, short), "--initial-state", str(state)])
    assert "each run from its initial state" in shown.output


def test_wrong_states_are_refused(jump, tmp_path):
    """One line names the option and what is allowed."""
    with pytest.raises(ParameterError, match=r"initial_state has shape \(3,\); allowed: \(2,\)"):
        chaosgym.read_machine(jump).from_state(np.zeros(3))
    (tmp_path / "words.txt").write_text("left right")
    for text, message in (
        ("random:x", "has no seed"),
        (str(tmp_path / "nothing.txt"), "can't be read"),
        (str(tmp_path / "words.txt"), "holds no numbers alone"),
    ):
        done = CliRunner().invoke(app, ["simulate", str(jump), "--initial-state", text])
        assert done.exit_code == 2
        assert message in done.output
    done = CliRunner().invoke(app, ["design", str(jump), str(jump), "--initial-state", "random:1"])
    assert done.exit_code == 2
    assert "--initial-state goes with one brief alone: a state belongs to one machine" in done.output
    other = chaosgym.ImpactBeam(excitation_frequency=10.0).from_state(np.full(12, 1e-6))
    with pytest.raises(ParameterError, match="axis 'n_modes' changes the model; an initial state belongs to one"):
        SweepPlan(other, (Axis("n_modes", 4, 6, 3),))
