"""The ladder of models: what a rung sets, what contradicts it, and that finer models come nearer to the finest."""

import json
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
from chaosgym.machines.accuracy import model_within
from chaosgym.machines.parameters import expand_fidelity, with_settings
from chaosgym.simulation import CycleRecord, simulate
from tests.plain_modes import HARD_BEAM
from thesis.scorecard.evaluation import THESIS_MACHINES


@pytest.mark.parametrize("machine", [ImpactBeam, SliderCrank])
def test_every_rung_sets_its_fields_and_is_recognised(machine):
    """A rung is a short name for its fields: equal machines, equal results."""
    for rung, fields in machine.fidelity_ladder.items():
        assert machine(fidelity=rung) == machine(**fields) == with_settings(machine(), {"fidelity": rung})
        assert machine(fidelity=rung).rung == rung


def test_a_machine_keeps_its_rung_when_other_fields_change():
    """Copies and pickles keep the model; a changed field of the ladder leaves it."""
    beam = ImpactBeam(fidelity="fine")
    assert replace(beam, clearance=1e-4).rung == "fine"
    assert pickle.loads(pickle.dumps(beam)) == beam
    assert replace(beam, n_modes=5).rung is None


@pytest.mark.parametrize(
    ("machine", "settings", "message"),
    [
        (ImpactBeam, {"fidelity": "fine", "n_modes": 5}, "'fine' sets n_modes = 10, and n_modes = 5 is given too"),
        (ImpactBeam, {"fidelity": "fine", "n_modes": 10}, "'fine' sets n_modes = 10, and n_modes = 10 is given too"),
        (SliderCrank, {"fidelity": "draft", "rod": "rigid"}, "'draft' sets rod = 'flexible', and rod = 'rigid'"),
        (ImpactBeam, {"fidelity": "flexible-1deg"}, "'flexible-1deg' is not one of standard, fine, reference"),
        (SliderCrank, {"fidelity": "finest"}, "'finest' is not one of draft, standard, fine, reference"),
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
    assert simulate(ImpactBeam(fidelity="standard"), 1).section.shape == (1, 12)
    assert simulate(SliderCrank(fidelity="draft"), 1).section.shape == (1, 10)


def test_finer_models_come_nearer_to_the_reference():
    """First touch in the first cycle: the tip's error falls from rung to rung.

    Fitted modes beat plain ones where damping grows with frequency, so that the modes left out only give way.
    """

    def motion(beam, **fields):
        beam = with_settings(replace(beam, excitation_frequency=19.0), fields)
        return simulate(beam, 1, samples_per_cycle=2000).history[0, :, 0]

    def errors_of(beam, models):
        reference = motion(beam, fidelity="reference")
        return [np.sqrt(np.mean((motion(beam, **model) - reference) ** 2)) for model in models]

    plain = {"n_modes": 1, "fitted_modes": 0}
    rungs = errors_of(ImpactBeam(), [plain, {"fidelity": "standard"}, {"fidelity": "fine"}])
    assert all(finer < coarser for coarser, finer in pairwise(rungs))
    models = [
        plain,
        {"n_modes": 5, "fitted_modes": 0},
        {"n_modes": 4, "fitted_modes": 1},
        {"fidelity": "standard"},
        {"fidelity": "fine"},
    ]
    errors = errors_of(HARD_BEAM, models)
    assert all(finer < coarser for coarser, finer in pairwise(errors))
    assert errors[3] < errors_of(HARD_BEAM, [{"n_modes": 8, "fitted_modes": 0}])[0]


def test_the_reference_does_not_move_with_twice_as_many_modes():
    """The zero of the beam's ladder, to a ten-thousandth: a hundredth of the error of ``fine``, and of a sensor.

    With damping of the beam alone, as of the hard pivot, high modes matter less: to a hundred-thousandth.
    """
    for frequency, clearance in ((19.0, 0.127e-3), (10.0, 0.1e-3), (6.0, 0.05e-3)):
        for beam, least in ((ImpactBeam(), 1e-4), (HARD_BEAM, 1e-5)):
            at = replace(beam, excitation_frequency=frequency, clearance=clearance)
            reference = with_settings(at, {"fidelity": "reference"})
            _agree(reference, replace(reference, n_modes=40), 30, peaks=least, path=least)


@pytest.mark.slow
def test_the_reference_of_the_crank_does_not_move_with_twice_as_many_modes():
    """The zero of the crank's ladder: at a periodic point to some hundred-thousandths, a tenth of ``fine``'s error."""
    reference = SliderCrank(fidelity="reference", crank_speed=270.0, slider_clearance=0.032e-3)
    _agree(reference, replace(reference, n_modes=10), 30, peaks=5e-5, path=5e-5)


def _agree(one, other, transient, *, peaks, path):
    """Mean peak forces of settled cycles, and the path over a cycle from rest, by their relative difference."""
    means = [simulate(machine, 10, transient=transient).peak_force.mean() for machine in (one, other)]
    assert means[0] == pytest.approx(means[1], rel=peaks)
    paths = [simulate(machine, 1, samples_per_cycle=500).history[0, :, 0] for machine in (one, other)]
    assert np.sqrt(np.mean((paths[0] - paths[1]) ** 2)) < path * np.sqrt(np.mean(paths[1] ** 2))


def test_the_reference_places_events_most_tightly():
    """Without an integrator the reference runs at an event tolerance of 1e-13, all others at 1e-9."""
    assert ImpactBeam(fidelity="reference").default_integrator.event_tolerance == 1e-13
    assert ImpactBeam(fidelity="fine").default_integrator.event_tolerance == 1e-9
    assert SliderCrank(fidelity="reference").default_integrator.event_tolerance == 1e-9


@pytest.mark.parametrize(("env_id", "rung"), [("chaosgym/ImpactBeam-v1", "fine"), ("chaosgym/SliderCrank-v1", "draft")])
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


def test_a_tolerance_is_one_model_for_all_machines_of_an_environment():
    """Opt-in: the cheapest model within it at speeds over the whole range; a field of it may not be given too."""
    env = gym.make("chaosgym/ImpactBeam-v1", fidelity="1 %")
    nominal, task = env.unwrapped.nominal, env.unwrapped.task
    points = [nominal.at(speed) for speed in np.linspace(task.lowest_speed, task.highest_speed, 5).tolist()]
    assert nominal.n_modes > 4
    assert model_within(nominal, "1 %", points).machine == nominal
    env.reset(seed=1)
    assert env.unwrapped.machine.n_modes == nominal.n_modes
    with pytest.raises(ParameterError, match="fidelity = '1 %' chooses n_modes"):
        gym.make("chaosgym/ImpactBeam-v1", fidelity="1 %", n_modes=5)


@pytest.mark.parametrize("machine", [ImpactBeam, SliderCrank])
def test_the_rung_standard_is_the_default(machine):
    """Of a machine, an environment and the command line. The thesis' own crank stands beside the ladder."""
    assert machine().rung == "standard"
    assert gym.make(f"chaosgym/{machine.__name__}-v1").unwrapped.nominal.rung == "standard"
    shown = CliRunner().invoke(app, ["show", machine.name, "--json"])
    settings = json.loads(shown.output)["parameters"]
    assert settings.items() >= machine.fidelity_ladder["standard"].items()
    assert THESIS_MACHINES[ImpactBeam.name] == ImpactBeam()
    assert THESIS_MACHINES[SliderCrank.name].rung is None


def test_the_command_line_takes_the_option():
    """--fidelity runs that model; with --set of one of its fields it ends in one line that names both."""
    run = CliRunner().invoke(app, ["simulate", "impact-beam", "--fidelity", "fine", "--cycles", "2", "--json"])
    assert run.exit_code == 0
    both = CliRunner().invoke(app, ["simulate", "impact-beam", "--fidelity", "fine", "--set", "n_modes=2"])
    assert isinstance(both.exception, ParameterError)
    assert "n_modes" in str(both.exception)


def test_a_fidelity_that_is_no_text_is_named():
    """A list in a brief, or a bare number, is one line and no traceback."""
    for given in ([], 3, {"a": 1}):
        with pytest.raises(ParameterError, match=r"is not one of .*, nor a tolerance"):
            expand_fidelity(ImpactBeam(), {"fidelity": given})
