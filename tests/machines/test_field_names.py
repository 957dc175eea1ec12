"""Every command knows a machine's speed and clearance by these words."""

import pytest

from chaosgym import ImpactBeam, SliderCrank
from chaosgym.branches.family_along import continuous_field
from chaosgym.fit.model_draws import fields_to_estimate
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate
from tests.cli.run import run, run_json


@pytest.mark.parametrize("machine", [ImpactBeam(), SliderCrank()])
def test_speed_and_clearance_name_fields_of_each_machine(machine):
    """In settings, branches, estimates and operations alike."""
    fields = {"speed": machine.speed_field, "clearance": machine.clearance_field}
    for name, field in fields.items():
        value = 1.01 * getattr(machine, field)
        assert getattr(with_settings(machine, {name: value}), field) == value
        assert continuous_field(machine, name) == field
        assert fields_to_estimate(machine, [name]) == (field,)
    speeds = [getattr(machine, machine.speed_field)] * 2
    assert simulate(machine, 2, operation={"speed": speeds}).peak_force.shape[0] == 2


def test_a_sweep_takes_the_word_speed_and_suggests_it(tmp_path):
    """As ``branch --along speed`` does; a misspelt one is met with the nearest."""
    words = ["sweep", "impact-beam", "--axis", "speed=10:12:2", "--budget", "100", "--label", "full-types=0"]
    run_json(*words, "--out", tmp_path / "a")
    refused = run("sweep", "impact-beam", "--axis", "sped=10:12:2", "--out", tmp_path / "b")
    assert "did you mean speed?" in refused[2]
    refused = run("sweep", "impact-beam", "--workers", "x", "--out", tmp_path / "b")
    assert "neither a number of threads, 1 to 4096, nor tcp://HOST:PORT" in refused[2]
