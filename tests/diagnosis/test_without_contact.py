"""Linear motion is never chaotic: machines that never touch, conserved motions, one contact only."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym import Drive, ModalMachine, Structure, diagnose
from chaosgym.cli import app
from chaosgym.series.exponent import average_growth


def machine(frequencies, ratios, force, speed, gap=1.0, **fields):
    """Modes with unit shapes under a sine at their point, between walls 1 m away."""
    modes = Structure.of_modes(frequencies, ratios, {"tip": np.linspace(0.9, 0.7, len(frequencies))})
    given = {"contact_stiffness": 1e5, "contact_damping": 0.0} | fields
    drives = (Drive.sine("force", "tip", force),)
    return ModalMachine(modes=modes, joint="tip", drives=drives, speed=speed, clearance=gap, **given)


@pytest.mark.parametrize("seed", range(12))
def test_machines_that_never_touch(seed):
    """Random modes, damped or not: never chaotic, and the reason says that nothing touched."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    ratios = rng.choice([0.0, 1e-6, 1e-3, 0.1], count)
    verdict = diagnose(machine(rng.uniform(0.1, 20.0, count), ratios, 1e-3, rng.uniform(0.1, 10.0)), budget=400)
    assert verdict.nature != "chaotic"
    assert "chaotic" not in verdict.votes.values()
    assert verdict.reason.startswith("no contact: the machine is linear")
    assert verdict.evidence["linear"]
    if np.all(ratios == 0.0):
        assert verdict.nature != "periodic" or verdict.votes["two_step"] == "periodic"


@pytest.mark.parametrize("frequencies", [[0.16], [0.16, 0.16 * np.sqrt(2.0)], [3.0, 3.001]])
def test_undamped_modes_give_a_sum_of_lines(frequencies):
    """One or two undamped modes, driven at another frequency: neither periodic nor chaotic, whatever the rounding."""
    verdict = diagnose(machine(frequencies, 0.0, 1e-3, 0.3111), budget=800)
    assert verdict.nature == "quasiperiodic"
    assert "sum of lines" in verdict.reason


def test_a_conserved_motion():
    """Without a drive an undamped mode that was set going goes on: 70 of its periods are 31 cycles; it is neutral."""
    verdict = diagnose(machine([0.7], 0.0, 0.0, 0.31), initial_state=[1e-3, 0.0], budget=400)
    assert verdict.words == "periodic, period 31, without contact, neutral"
    assert verdict.orbit.largest_multiplier == pytest.approx(1.0, abs=1e-9)


def test_a_free_body_that_drifts_is_not_judged():
    """A rigid body under a force starts to drift: linear, but contact will come; undetermined, never chaotic."""
    verdict = diagnose(machine([0.0], 0.0, 1e-6, 1.0, gap=10.0), budget=400)
    assert verdict.nature == "undetermined"
    assert "grows" in verdict.reason


def test_contact_at_the_start_only():
    """A motion that touches at its start and then swings free: the settled part is linear, and periodic."""
    struck = machine([0.5], 0.003, 1e-3, 0.2, gap=0.1, contact_damping=100.0, stops="one")
    verdict = diagnose(struck, initial_state=[0.0, 1.0], budget=800)
    assert 0 < verdict.run.impacts.sum() < 100
    assert verdict.evidence["linear"]
    assert verdict.nature == "periodic"


@pytest.mark.parametrize("contact_damping", [0.0, 100.0, 3e4])
def test_a_conserved_motion_that_touches_is_not_chaotic(contact_damping):
    """One undamped mode set going against one stop has two coordinates and no drive: it can't be chaotic."""
    struck = machine([0.5], 0.0, 0.0, 0.2, gap=0.1, contact_damping=contact_damping, stops="one")
    verdict = diagnose(struck, initial_state=[0.0, 1.0], budget=1600)
    assert verdict.nature != "chaotic"
    assert verdict.votes["lyapunov"] != "chaotic"


def test_rounding_and_slow_growth_have_no_sign():
    """An exponent of 2e-17 with a standard error of 2e-18 is zero, and so is what time alone stretches."""
    growth = 2e-17 + 1e-17 * np.sin(np.arange(1000.0))
    assert average_growth(growth).sign == 0
    assert average_growth(growth - 1e-9).sign == -1
    assert average_growth(1.0 / np.arange(1600.0, 3200.0)).sign == 0
    assert average_growth(np.full(1600, 0.01)).sign == 1


def test_the_command_says_so(tmp_path):
    """Text and JSON name the reason of a machine that never touches."""
    path = tmp_path / "linear.toml"
    path.write_text(
        """
[structure]
frequencies = "0.16 Hz"
damping_ratios = "0 %"
shapes = { tip = "1 kg^-1/2" }
[joint]
at = "tip"
clearance = "2 mm"
stops = "one"
stiffness = "0.1 N/um"
damping = "0 N s/m"
[[drive]]
at = "tip"
force = "0.001 N"
[operation]
speed = "0.3111 Hz"
speed_range = "0.1 to 1 Hz"
clearance_range = "1 to 4 mm"
"""
    )
    text = CliRunner().invoke(app, ["diagnose", str(path), "--budget", "400"], catch_exceptions=False).output
    assert "quasiperiodic" in text
    assert "no contact: the machine is linear" in text
    told = json.loads(CliRunner().invoke(app, ["diagnose", str(path), "--budget", "400", "--json"]).stdout)
    assert told["evidence"]["linear"] is True
    assert told["nature"] == "quasiperiodic"
