"""What a user should know of a machine stands beside every result of it."""

import json

import pytest
from click.testing import CliRunner

from chaosgym import ImpactBeam, SliderCrank
from chaosgym.cli import app
from chaosgym.machines.slider_crank.machine import DIMENSIONS


@pytest.mark.parametrize("field", DIMENSIONS)
def test_a_crank_of_other_dimensions_names_what_is_still_fitted(field):
    """One line names the fitted masses, the contact stiffness and the damping mass that were not given."""
    other = SliderCrank(**{field: 1.1 * getattr(SliderCrank(), field)})
    (note,) = other.notes
    named, kept = note.split(": not the thesis' crank, yet these are still fitted to it: ")
    assert named == field
    assert "\n" not in note
    for name in {"yoke_mass", "contact_stiffness", "contact_damping_mass", "slider_mass"} - {field}:
        assert name in kept
    assert "contact_damping_mass 6.908 kg" in kept


def test_what_is_given_is_not_named():
    """Constants that the user gives are no longer the thesis'; the thesis' own crank has nothing to say."""
    other = SliderCrank(rod_length=0.3, contact_stiffness=2e7, contact_damping_mass=1.0)
    assert "contact" not in other.notes[0]
    assert (
        SliderCrank().notes == SliderCrank(crank_speed=250.0, slider_clearance=1e-4).notes == ImpactBeam().notes == ()
    )


@pytest.mark.parametrize("command", ["show", "simulate", "diagnose"])
def test_commands_end_with_the_notes(command):
    """Text has the note as its last line, JSON under ``notes``."""
    more = {"show": [], "simulate": ["--cycles", "2"], "diagnose": ["--budget", "100"]}[command]
    line = [command, "slider-crank", "--set", "crank_radius=45 mm", *more]
    text = CliRunner().invoke(app, line, catch_exceptions=False)
    assert text.exit_code == 0, text.output
    assert text.stdout.rstrip().splitlines()[-1].startswith("note: crank_radius: not the thesis' crank")
    told = json.loads(CliRunner().invoke(app, [*line, "--json"], catch_exceptions=False).stdout)
    assert told["notes"][0].startswith("crank_radius")
    assert "notes" not in json.loads(CliRunner().invoke(app, ["show", "slider-crank", "--json"]).stdout)
