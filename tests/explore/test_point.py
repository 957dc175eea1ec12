"""What is shown of a point is what the library says of it, and can be taken along as link, Python and command."""

import json
import shlex
from urllib.parse import parse_qsl

import numpy as np
import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym.cli import app
from chaosgym.errors import ParameterError
from chaosgym.explore.point import (
    command_of,
    link_of,
    machine_from,
    orbit_diagram,
    python_of,
    sliders_of,
    view_of,
)
from chaosgym.machines import MACHINES, ImpactBeam, SliderCrank
from tests.third_machine import ImpactOscillator

BEAM = ImpactBeam(excitation_frequency=19.0, clearance=1e-4)


@pytest.mark.parametrize("kind", [ImpactBeam, SliderCrank, ImpactOscillator])
def test_every_machine_has_sliders_of_speed_clearance_and_damping(kind):
    """Their ranges hold the machine's own value, within what is allowed."""
    machine = kind()
    sliders = sliders_of(machine)
    assert [slider.field for slider in sliders[:2]] == [machine.speed_field, machine.clearance_field]
    assert "damping" in sliders[2].field
    for slider in sliders:
        assert slider.low <= getattr(machine, slider.field) <= slider.high
        machine.at(slider.low) if slider is sliders[0] else None


def test_the_view_is_the_diagnosis():
    """Nature and period as ``diagnose`` tells them; the motion shown is that of the last settled cycles."""
    view, verdict = view_of(BEAM), chaosgym.diagnose(BEAM, budget=400)
    assert view.headline.startswith(f"{verdict.nature}, period {verdict.period}")
    np.testing.assert_array_equal(view.peaks, verdict.judged.peak_force[:, verdict.judged.worst_side])
    np.testing.assert_allclose(view.displacement[::300][:6], verdict.judged.displacement[-6:], rtol=1e-9)
    assert any(line.startswith("classifier: periodic") for line in view.lines)
    assert any(line.startswith("monitor") and "no alarm in 64 cycles" in line for line in view.lines)


def test_the_monitor_hears_enough_of_a_motion_that_was_proven_at_once():
    """A period that is proven after 16 cycles leaves 8 judged ones, too few for the monitor."""
    beam = ImpactBeam(excitation_frequency=6.0)
    assert len(chaosgym.diagnose(beam, budget=400).judged) < 12
    assert any(line.startswith("monitor") and "no alarm in 64 cycles" in line for line in view_of(beam).lines)


def test_a_machine_of_several_joints_is_classified():
    """Its modes are a field that nobody sets, so the classifier for any machine takes it as it is."""
    machine = MACHINES["docs/machines/pipe-in-two-supports.toml"]()
    (line,) = [line for line in view_of(machine).lines if line.startswith("classifier")]
    assert line.startswith("classifier: chaotic, probability")


def test_a_machine_without_contact_says_so():
    """A gap that is never closed has no peaks, and no verdict hides it."""
    assert any("no contact" in line for line in view_of(ImpactBeam(clearance=0.1)).lines)


def test_the_classifier_answers_by_the_model_that_it_knows():
    """Another model of the beam is shown by default; the classifier's answer names its own."""
    lines = view_of(ImpactBeam(excitation_frequency=12.0, fidelity="fine")).lines
    assert any(line.startswith("classifier: periodic, of the standard model, ") for line in lines)


def test_a_machine_without_classifier_is_shown_too():
    """The oscillator of the tests has none: a general one reads its forces."""
    assert any(line.startswith("classifier: chaotic, probability") for line in view_of(ImpactOscillator()).lines)


def test_link_and_python_give_the_same_machine():
    """Whoever gets one of them gets to the same point."""
    asked = dict(parse_qsl(link_of(BEAM)))
    assert machine_from(asked.pop("machine"), asked) == BEAM
    names: dict = {}
    exec(python_of(BEAM).replace("print", "str"), names)
    assert names["machine"] == BEAM


def test_a_machine_by_file_is_shown_and_taken_along(tmp_path):
    """One's own machine has sliders, link and Python; no link opens the file of another."""
    path = tmp_path / "own.toml"
    path.write_text(CliRunner().invoke(app, ["new-machine", "modes"]).stdout)
    kind = MACHINES[str(path)]
    machine = kind(clearance=0.9 * kind().clearance)
    assert len(sliders_of(machine)) == 3
    assert view_of(machine).headline
    asked = dict(parse_qsl(link_of(machine)))
    assert machine_from(asked.pop("machine"), asked, str(path)) == machine
    names: dict = {}
    exec(python_of(machine).replace("print", "str"), names)
    assert names["machine"] == machine
    with pytest.raises(ParameterError, match="is not one of"):
        machine_from(str(path), {})


def test_the_command_judges_the_same_machine():
    """Its verdict is that of the page."""
    words = shlex.split(command_of(BEAM))[1:]
    told = json.loads(CliRunner().invoke(app, [*words, "--budget", "400", "--json"]).stdout)
    assert told["peak_force_summary_N"]["max"] == pytest.approx(view_of(BEAM).peaks.max())


def test_a_wrong_link_says_what_is_wrong():
    """Machine, field and value are named."""
    for machine, fields, message in (
        ("engine", {}, "is not one of"),
        ("impact-beam", {"clearence": "1"}, "did you mean clearance"),
        ("impact-beam", {"clearance": "wide"}, "is no number"),
    ):
        with pytest.raises(ParameterError, match=message):
            machine_from(machine, fields)


def test_the_orbit_diagram_is_that_of_single_runs():
    """Each speed is a run from rest."""
    slider = sliders_of(BEAM)[0]
    speed, peaks = next(iter(orbit_diagram(BEAM, slider)))
    record = chaosgym.simulate(BEAM.at(speed), 30, transient=60)
    assert speed == slider.low
    np.testing.assert_array_equal(peaks, np.unique(np.round(record.peak_force[:, 0], 3)))
