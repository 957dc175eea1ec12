"""The ladder of models: what a rung sets, what contradicts it, and that finer models come nearer to the finest."""

import pickle
from dataclasses import replace
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym.cli import app
from chaosgym.errors import ParameterError
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import CycleRecord, simulate


@pytest.mark.parametrize("machine", [ImpactBeam, SliderCrank])
def test_every_rung_sets_its_fields_and_is_recognised(machine):
    """A rung is a short name for its fields: equal machines, equal results; the default is on the ladder."""
    for rung, fields in machine.fidelity_ladder.items():
        assert machine(fidelity=rung) == machine(**fields) == with_settings(machine(), {"fidelity": rung})
        assert machine(fidelity=rung).rung == rung
    assert machine().rung == {"impact-beam": "modes-5", "slider-crank": "flexible-1deg"}[machine.name]


def test_a_machine_keeps_its_rung_when_other_fields_change():
    """Copies and pickles keep the model; a changed field of the ladder leaves it."""
    beam = ImpactBeam(fidelity="modes-3")
    assert replace(beam, clearance=1e-4).rung == "modes-3"
    assert pickle.loads(pickle.dumps(beam)) == beam
    assert replace(beam, n_modes=4).rung is None


@pytest.mark.parametrize(
    ("machine", "settings", "message"),
    [
        (ImpactBeam, {"fidelity": "modes-3", "n_modes": 5}, "'modes-3' sets n_modes = 3, and n_modes = 5 is given too"),
        (ImpactBeam, {"fidelity": "rigid", "n_modes": 1}, "'rigid' sets n_modes = 1, and n_modes = 1 is given too"),
        (SliderCrank, {"fidelity": "rigid", "rod": "flexible"}, "'rigid' sets rod = 'rigid', and rod = 'flexible'"),
        (ImpactBeam, {"fidelity": "flexible-1deg"}, "'flexible-1deg' is not one of restitution, rigid, modes-3"),
    ],
)
def test_a_rung_and_a_field_that_it_sets_contradict_each_other(machine, settings, message):
    """Both together are an error that names both, even where they agree; so is a rung of another machine."""
    for make in (lambda: machine(**settings), lambda: with_settings(machine(), settings)):
        with pytest.raises(ParameterError, match=message):
            make()


@pytest.mark.parametrize("machine", [ImpactBeam, SliderCrank])
def test_every_rung_answers_with_the_same_record(machine):
    """Peak forces, impacts and contact come from every model, and only its own states are integrated."""
    for rung in machine.fidelity_ladder:
        record = simulate(machine(fidelity=rung), 2, samples_per_cycle=8)
        assert isinstance(record, CycleRecord)
        assert record.peak_force.shape == (2, 2)
        assert record.history.shape == (2, 8, 3)
        assert np.all(record.peak_force > 0.0)
    assert simulate(ImpactBeam(fidelity="rigid"), 1).section.shape == (1, 2)
    assert simulate(SliderCrank(fidelity="rigid"), 1).section.shape == (1, 2)


def test_more_modes_come_nearer_to_the_reference():
    """First touch in the first cycle: the error of the tip's motion falls from rung to rung."""

    def motion(rung):
        return simulate(ImpactBeam(fidelity=rung, excitation_frequency=19.0), 1, samples_per_cycle=2000).history[
            0, :, 0
        ]

    reference = motion("reference")
    errors = [np.sqrt(np.mean((motion(rung) - reference) ** 2)) for rung in ("rigid", "modes-3", "modes-5", "modes-8")]
    assert all(finer < coarser for coarser, finer in pairwise(errors))


def test_the_reference_places_events_most_tightly():
    """Without an integrator the reference runs at an event tolerance of 1e-13, all others at 1e-9."""
    assert ImpactBeam(fidelity="reference").default_integrator.event_tolerance == 1e-13
    assert ImpactBeam(fidelity="modes-8").default_integrator.event_tolerance == 1e-9
    assert SliderCrank(fidelity="reference").default_integrator.event_tolerance == 1e-9


@pytest.mark.parametrize(
    ("env_id", "rung"), [("chaosgym/ImpactBeam-v0", "restitution"), ("chaosgym/SliderCrank-v0", "rigid")]
)
def test_environments_take_the_keyword(env_id, rung):
    """gym.make(..., fidelity=rung) runs that model; a field that it sets may not be given too."""
    assert chaosgym.__version__
    env = gym.make(env_id, fidelity=rung)
    observation, _ = env.reset(seed=1)
    assert env.unwrapped.machine.rung == rung
    assert np.all(np.isfinite(observation))
    field = next(iter(env.unwrapped.nominal.fidelity_ladder[rung]))
    with pytest.raises(ParameterError, match=f"{rung}.*{field}"):
        gym.make(env_id, fidelity=rung, **{field: getattr(env.unwrapped.nominal, field)})
    env.close()


def test_the_crank_environment_updates_its_matrices_every_five_degrees():
    """Its default is the rung flexible-5deg, and the interval may still be given by itself."""
    assert gym.make("chaosgym/SliderCrank-v0").unwrapped.nominal.rung == "flexible-5deg"
    assert gym.make("chaosgym/SliderCrank-v0", matrix_update_interval=1.0).unwrapped.nominal.rung == "flexible-1deg"


def test_the_command_line_takes_the_option():
    """--fidelity runs that model; with --set of one of its fields it ends in one line that names both."""
    run = CliRunner().invoke(app, ["simulate", "impact-beam", "--fidelity", "rigid", "--cycles", "2", "--json"])
    assert run.exit_code == 0
    both = CliRunner().invoke(app, ["simulate", "impact-beam", "--fidelity", "rigid", "--set", "n_modes=2"])
    assert isinstance(both.exception, ParameterError)
    assert "n_modes" in str(both.exception)
