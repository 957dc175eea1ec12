"""Environments are found by id, wherever they are made."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

import chaosgym.envs
from chaosgym.envs import ENVIRONMENTS, register_environments
from chaosgym.errors import ParameterError


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_registering_again_changes_nothing_and_warns_of_nothing(name: str) -> None:
    """The ids are registered by importing the package, once."""
    before = gym.spec(name)
    register_environments()
    assert gym.spec(name) is before


@pytest.mark.parametrize(
    "imports",
    [
        "import chaosgym, gymnasium",
        "import gymnasium, chaosgym",
        "import chaosgym; from gymnasium.envs.registration import register; import gymnasium",
        "import chaosgym; chaosgym.envs; import gymnasium",
        "import chaosgym.envs.machine_env, gymnasium",
    ],
)
def test_ids_are_known_whatever_is_imported_first(imports: str) -> None:
    """Once both packages are imported, an id names a specification."""
    code = f"{imports}; print(gymnasium.spec('chaosgym/ImpactBeam-v1').id)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "chaosgym/ImpactBeam-v1"


def test_importing_the_package_loads_neither_kernels_nor_plots() -> None:
    """Registration costs no more than importing gymnasium."""
    code = "import sys, chaosgym, gymnasium; print([m for m in ('numba', 'scipy', 'matplotlib') if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_an_id_can_name_the_package_to_import() -> None:
    """Nothing but the id is needed in a fresh process."""
    code = "import gymnasium; print(gymnasium.make('chaosgym:chaosgym/ImpactBeam-v1').spec.id)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "chaosgym/ImpactBeam-v1"


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_spec_survives_json(name: str) -> None:
    """An environment made from the JSON of its spec is the same, keywords included."""
    machine = gym.make(name).unwrapped.nominal
    env = gym.make(name, **{machine.clearance_field: 0.2e-3}, steps=5, tolerances={machine.clearance_field: 0.1})
    assert env.spec is not None
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    first, second = (e.reset(seed=3)[0] for e in (env, again))
    assert np.array_equal(first, second)
    assert again.unwrapped.nominal == env.unwrapped.nominal


def test_every_id_can_be_made_or_asks_for_a_file() -> None:
    """No id is listed that only raises: those of no machine name the file or the plant that they want."""
    for name in [name for name in gym.registry if name.startswith("chaosgym/")]:
        if "machine" in gym.spec(name).kwargs:
            gym.make(name).close()
        else:
            with pytest.raises(ParameterError, match=r"machine = '' does not exist|a plant is given by fmu=FILE"):
                gym.make(name)


def test_the_time_limit_wrapper_truncates() -> None:
    """Only max_episode_steps truncates."""
    env = gym.make("chaosgym/ImpactBeam-v1", max_episode_steps=3)
    env.reset(seed=0)
    flags = [env.step(0)[2:4] for _ in range(3)]
    assert flags == [(False, False), (False, False), (False, True)]


def test_entry_points_are_strings() -> None:
    """Strings are what a spawned worker can load."""
    assert all(isinstance(gym.spec(name).entry_point, str) for name in chaosgym.envs.ENVIRONMENTS)


def test_what_needs_stable_baselines3_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is an extra, and who reads Gymnasium's pages may not have it."""
    for name in {"stable_baselines3", *(name for name in sys.modules if name.startswith("stable_baselines3."))}:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "chaosgym.envs.sb3", raising=False)
    with pytest.raises(ImportError, match=r"SB3VecEnv needs stable-baselines3: pip install '\.\[learn\]'"):
        _ = chaosgym.envs.SB3VecEnv
