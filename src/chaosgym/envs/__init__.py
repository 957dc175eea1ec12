"""The Gymnasium environments: importing this registers them, without importing numba or matplotlib.

``SB3VecEnv``, for stable-baselines3, and ``VisitedSpeeds``, a wrapper with a memory, are imported when asked for.
"""

from dataclasses import replace
from importlib import import_module
from typing import Any

from gymnasium.envs.registration import EnvSpec, register, registry

from chaosgym.errors import ParameterError, nearest_or
from chaosgym.machines import FILE_ENDING, MACHINES

TASKS: dict[str, dict[str, Any]] = {
    "": {"level": "nominal"},
    "Tolerance": {"level": "clearance"},
    "Wear": {"level": "wear"},
}
"""Keywords of each task; ``chaosgym.envs.levels`` says what the levels are, "fleet" among them."""

ENVIRONMENTS = tuple(f"chaosgym/{MACHINES.class_name(name)}{task}-v1" for name in MACHINES for task in TASKS)
"""Ids of chaosgym's own machines."""

_ENTRY_POINT = "chaosgym.envs.machine_env:MachineEnv"

_LATER = {"SB3VecEnv": "chaosgym.envs.sb3", "VisitedSpeeds": "chaosgym.envs.memory"}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        try:
            return getattr(import_module(_LATER[name]), name)
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] != "stable_baselines3":
                raise
            raise ImportError(
                f"{name} needs stable-baselines3: pip install '.[learn]' in a clone of chaosgym"
            ) from None
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register_environments() -> None:
    """Make the environments of every registered machine known to ``gymnasium.make``; a second call changes nothing."""
    for machine in MACHINES:
        for task, keywords in TASKS.items():
            _register(f"chaosgym/{MACHINES.class_name(machine)}{task}-v1", {"machine": machine, **keywords})
    for task, keywords in TASKS.items():
        _register(f"chaosgym/Machine{task}-v0", keywords)
    _register("chaosgym/AnyMachine-v0", {"machine": "any", "objective": "life"})
    if "chaosgym/Plant-v0" not in registry:
        register(id="chaosgym/Plant-v0", entry_point="chaosgym.envs.plant_env:PlantEnv")


def _register(name: str, keywords: dict[str, Any]) -> None:
    if name in registry:
        return
    register(
        id=name,
        entry_point=_ENTRY_POINT,
        vector_entry_point="chaosgym.envs.vector_env:MachineVectorEnv",
        kwargs=keywords,
    )


def environment(env: str) -> EnvSpec:
    """Specification of an environment: that of an id, or of a machine's file, which runs within its tolerances.

    Raises
    ------
    ParameterError
        If there is no such id, among those of registered machines.
    """
    if env.endswith(FILE_ENDING):
        tolerance = registry["chaosgym/MachineTolerance-v0"]
        return replace(tolerance, kwargs={**tolerance.kwargs, "machine": env})
    found = registry.get(env)  # gymnasium.spec would import the module of an id like "module:name"
    if found is None or found.entry_point != _ENTRY_POINT:
        ours = {name: spec for name, spec in registry.items() if spec.entry_point == _ENTRY_POINT}
        known = [name for name, spec in ours.items() if "machine" in spec.kwargs]
        listed = f"known: {', '.join(known)}, or a file my-machine.toml"
        raise ParameterError(f"env = {env!r} is unknown; {nearest_or(listed, env, known)}")
    return found


register_environments()
