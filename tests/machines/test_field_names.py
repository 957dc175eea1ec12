"""Every command knows a machine's speed and clearance by these words."""

from typing import get_args

import pytest

from chaosgym import ImpactBeam, SliderCrank
from chaosgym.branches.family_along import continuous_field
from chaosgym.fit.model_draws import fields_to_estimate
from chaosgym.machines import MACHINES
from chaosgym.machines.modal_machine.places import terms_of
from chaosgym.machines.parameters import Provenance, markdown_table, parameters_of, with_settings
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


@pytest.mark.parametrize("machine", [*MACHINES.values()])
def test_every_number_says_where_it_is_from(machine):
    """By one of the five words of the documentation, in the table of its page too."""
    rows, one = markdown_table(machine()), machine()
    known = parameters_of(one)
    assert {about.provenance for about in known.values()} <= set(get_args(Provenance))
    clearance = getattr(one, one.clearance_field)
    assert any(row.startswith(f"| `{one.clearance_field}` | {clearance:.6g} | m | ") for row in rows)
    assert len(rows) == 2 + len(known)


@pytest.mark.parametrize(
    ("place", "term"),
    [
        ("arm", (1.0, "arm", False)),
        ("2 arm", (2.0, "arm", False)),
        ("- 1/4 arm", (-0.25, "arm", False)),
        ("50 mm arm", (0.05, "arm", True)),
    ],
)
def test_a_factor_with_a_unit_is_a_lever(place, term):
    """A radius at which a point turns; a plain number is a ratio."""
    (found,) = terms_of(place)
    assert found == (pytest.approx(term[0]), *term[1:])
