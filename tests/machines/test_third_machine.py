"""A machine that chaosgym has never seen, written with public names, is taken by every command and task."""

import json

import gymnasium as gym
import numpy as np
import pytest
from click.testing import CliRunner, Result

import chaosgym
from benchmarks.fidelity.stability import stability_map
from chaosgym.cli import app
from chaosgym.envs import TASKS, register_environments
from chaosgym.errors import ChaosgymError
from chaosgym.machines import MACHINES, register_machine
from chaosgym.machines.machine import Machine
from tests.design.small import small_studies
from tests.third_machine import ImpactOscillator

NAME = ImpactOscillator.name


@pytest.fixture(scope="module", autouse=True)
def registered():
    """The machine is known to every command and task while these tests run."""
    register_machine(ImpactOscillator)
    yield
    del MACHINES.entry_points[NAME]


def run(*arguments: str) -> Result:
    """Run a command in this process; any error but one that chaosgym raises on purpose fails the test."""
    result = CliRunner().invoke(app, [*map(str, arguments)])
    if result.exception and not isinstance(result.exception, SystemExit | ChaosgymError):
        raise result.exception
    return result


def answer(*arguments: str) -> dict:
    """JSON object of a command that must succeed."""
    result = run(*arguments, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A small labelled sweep of the oscillator."""
    folder = tmp_path_factory.mktemp("sweep") / "sweep"
    axes = ("--axis", "frequency=5:9:9:log", "--axis", "gap=5e-4:1e-3:6:log")
    found = answer(
        "sweep", NAME, *axes, "--budget", 200, "--label", "signals=1", "--label", "full-types=0.1", "--out", folder
    )
    assert found["points"] == 54
    return folder


def test_it_is_simulated_exactly():
    """Its record agrees with Runge-Kutta's of small steps over the first cycles."""
    machine = ImpactOscillator(frequency=6.0)
    exact = chaosgym.simulate(machine, 3)
    fixed = chaosgym.simulate(machine, 3, integrator=chaosgym.RungeKutta4(200_000))
    np.testing.assert_allclose(exact.section, fixed.section, atol=1e-4 * np.abs(exact.section).max())
    assert exact.impacts.sum() > 0


def test_simulate_and_show():
    """Its own option is taken, and one of another machine refused by name."""
    assert len(answer("simulate", NAME, "--gap-mm", 1, "--cycles", 4)["peak_force_N"]) == 4
    assert answer("show", NAME)["natural_frequencies_hz"] == pytest.approx([np.sqrt(1e3) / (2 * np.pi)])
    refused = run("simulate", NAME, "--speed-rpm", 3)
    assert refused.exit_code == 2
    assert "--gap-mm" in refused.output


def test_diagnose():
    """Nature and type speak of one run."""
    found = answer("diagnose", NAME, "--budget", 200, "--types")
    assert found["nature"] in ("periodic", "chaotic", "quasiperiodic", "undetermined")
    assert found["response_type"] in ("I", "II", "III", "undetermined")


def test_classify_with_and_without_a_trained_model(sweep, tmp_path):
    """Without a shipped model the general one answers; a trained one knows the parameters."""
    general = answer("classify", NAME)
    assert general["stage"] in ("certificate", "128 cycles")
    trained = run("train-classifier", "--data", sweep, "--out", tmp_path / "model", "--json")
    assert trained.exit_code == 0, trained.output
    model = next((tmp_path / "model").glob("*.npz"))
    told = answer("classify", NAME, "--model", model)
    assert sum(told["nature_probabilities"].values()) == pytest.approx(1.0)
    assert told["response_type"] in ("I", "II", "III", None)


def test_dataset(sweep, tmp_path):
    """A sweep is described and drawn."""
    assert answer("dataset", "info", sweep)["machine"] == NAME
    assert run("dataset", "map", sweep, "--out", tmp_path / "map.png").exit_code == 0


def test_design_report(tmp_path):
    """The template of a brief, of fewer machines within the tolerances, gives a report."""
    brief, text = tmp_path / "brief.toml", run("design", "--template", NAME).stdout
    assert "\nseries = 32 " in text
    brief.write_text(text.replace("\nseries = 32 ", "\nseries = 8 "))
    with small_studies():
        found = answer("design", brief, "--verdict-only", "--out", tmp_path / "report.html")
    assert found["machine"]["name"] == NAME if isinstance(found["machine"], dict) else found["machine"] == NAME
    assert NAME in (tmp_path / "report.html").read_text()


def test_tradeoff_and_stability(tmp_path):
    """Its one rung is its own reference; every extreme ends in an answer or a named error."""
    rows = answer("tradeoff", NAME, "--points", 2, "--cycles", 20, "--transient", 10, "--out", tmp_path)["rows"]
    assert {row["rung"] for row in rows} == {"reference"}
    assert {cell.outcome for cell in stability_map(MACHINES[NAME]()).cells} <= {"answer", "named error"}


@pytest.mark.parametrize("task", TASKS)
def test_environments(task):
    """Every task is made, steps, and is drawn; the vector environment gives the same observations."""
    register_environments()
    name = f"chaosgym/ImpactOscillator{task}-v1"
    env = gym.make(name, render_mode="rgb_array")
    first, _ = env.reset(seed=1)
    env.step(env.action_space.sample())
    assert env.render().ndim == 3
    envs = gym.make_vec(name, num_envs=2)
    observations, _ = envs.reset(seed=1)
    np.testing.assert_array_equal(observations[0], first)


def test_coordinates_count_alike_whatever_their_unit():
    """The weight of a coordinate is one over its size; what is nothing beside the others weighs as the largest."""
    assert Machine.state_weights(ImpactOscillator(), np.array([2.0, -4.0])).tolist() == [0.5, 0.25]
    assert Machine.state_weights(ImpactOscillator(), np.array([0.0, 4.0])).tolist() == [0.25, 0.25]
