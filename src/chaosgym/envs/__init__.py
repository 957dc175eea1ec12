"""The Gymnasium environments: importing this registers them, without importing numba or matplotlib.

``SB3VecEnv``, for stable-baselines3, and ``VisitedSpeeds``, a wrapper with a memory, are imported when asked for.
"""

from importlib import import_module
from typing import Any

from gymnasium.envs.registration import register, registry

from chaosgym.machines.registry import MACHINES

TASKS: dict[str, dict[str, Any]] = {
    "": {"tolerances": {}},
    "Tolerance": {},
    "Wear": {"wear": 0.1},
}
"""Keywords of each task: the nominal machine, one drawn within tolerances, one whose clearance grows too."""

ENVIRONMENTS = tuple(f"chaosgym/{MACHINES.class_name(name)}{task}-v1" for name in MACHINES for task in TASKS)
"""Ids of chaosgym's own machines."""

_LATER = {"SB3VecEnv": "chaosgym.envs.sb3", "VisitedSpeeds": "chaosgym.envs.memory"}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register_environments() -> None:
    """Make the environments of every registered machine known to ``gymnasium.make``; again does nothing new."""
    for machine in MACHINES:
        for task, keywords in TASKS.items():
            _register(f"chaosgym/{MACHINES.class_name(machine)}{task}-v1", {"machine": machine, **keywords})
    for task, keywords in TASKS.items():
        _register(f"chaosgym/Machine{task}-v0", keywords)


def _register(name: str, keywords: dict[str, Any]) -> None:
    if name in registry:
        return
    register(
        id=name,
        entry_point="chaosgym.envs.machine_env:MachineEnv",
        vector_entry_point="chaosgym.envs.vector_env:MachineVectorEnv",
        kwargs=keywords,
    )
    if name in ENVIRONMENTS:
        gone = "chaosgym.envs.gone:refuse"
        old = name.replace("-v1", "-v0")
        register(id=old, entry_point=gone, vector_entry_point=gone, kwargs={"successor": name})


register_environments()
