"""The machines that were fitted to the thesis, beside the library's defaults."""

import json

import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym.cli import app
from chaosgym.machines.parameters import parameters_of

FITTED = (chaosgym.THESIS_IMPACT_BEAM, chaosgym.THESIS_SLIDER_CRANK)


def shown(*arguments):
    """What ``chaosgym show`` says, as JSON."""
    done = CliRunner().invoke(app, ["show", *arguments, "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


@pytest.mark.parametrize("machine", FITTED, ids=lambda machine: machine.name)
def test_the_command_line_knows_the_fitted_machine(machine):
    """--constants thesis is the named machine, and no number of it is without a source."""
    answer = shown(machine.name, "--constants", "thesis")
    assert answer["parameters"] == {name: getattr(machine, name) for name in parameters_of(machine)}
    for name in parameters_of(machine):
        origin, default = answer["provenance"][name], getattr(type(machine)(), name)
        assert origin["grade"] != "given"
        if getattr(machine, name) != default:
            assert origin["source"] == machine.thesis_fit[name].source
    assert answer["provenance"]["damping_family"]["source"].endswith("see docs/development/calibration.md")


@pytest.mark.parametrize("machine", FITTED, ids=lambda machine: machine.name)
def test_the_default_is_not_the_fitted_machine(machine):
    """Datasets, classifier and agents rest on the default, which ``library`` names; a field that is set counts."""
    assert shown(machine.name, "--constants", "library") == shown(machine.name)
    answer = shown(machine.name, "--constants", "thesis", "--set", "damping_ratio=0.03")
    assert answer["parameters"]["damping_ratio"] == 0.03
    assert answer["provenance"]["damping_ratio"]["grade"] == "given"


def test_printed_numbers_are_not_fitted():
    """The fit leaves alone what the thesis prints, but for the model that it prints: degrees of freedom, interfaces."""
    for machine in FITTED:
        described = parameters_of(machine)
        touched = {name for name in machine.thesis_fit if described[name].provenance == "printed"}
        assert touched == set()
