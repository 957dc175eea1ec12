"""The Gymnasium environments: importing this registers them, without importing numba or matplotlib.

``SB3VecEnv``, for stable-baselines3, and ``VisitedSpeeds``, a wrapper with a memory, are imported when asked for.
"""

from importlib import import_module
from typing import Any

from gymnasium.envs.registration import register, registry

MACHINES = {"impact-beam": "ImpactBeam", "slider-crank": "SliderCrank"}
"""Names of chaosgym's own machines on the command line, and in ids."""

TASKS: dict[str, dict[str, Any]] = {
    "": {"tolerances": {}},
    "Tolerance": {},
    "Wear": {"wear": 0.1},
}
"""Keywords of each task: the nominal machine, one drawn within tolerances, one whose clearance grows too."""

ENVIRONMENTS = tuple(f"chaosgym/{machine}{task}-v1" for machine in MACHINES.values() for task in TASKS)
"""Ids of chaosgym's own machines."""

_LATER = {"SB3VecEnv": "chaosgym.envs.sb3", "VisitedSpeeds": "chaosgym.envs.memory"}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register_environments() -> None:
    """Make the environments of every registered machine known to ``gymnasium.make``; again does nothing new."""
    from chaosgym.machines.registry import MACHINES as EVERY

    _register({machine: EVERY.class_name(machine) for machine in EVERY})


def _register(machines: dict[str, str]) -> None:
    for machine, name in machines.items():
        for task, keywords in TASKS.items():
            new, old = f"chaosgym/{name}{task}-v1", f"chaosgym/{name}{task}-v0"
            if new in registry:
                continue
            register(
                id=new,
                entry_point="chaosgym.envs.machine_env:MachineEnv",
                vector_entry_point="chaosgym.envs.vector_env:MachineVectorEnv",
                kwargs={"machine": machine, **keywords},
            )
            if new in ENVIRONMENTS:
                gone = "chaosgym.envs.gone:refuse"
                register(id=old, entry_point=gone, vector_entry_point=gone, kwargs={"successor": new})


_register(MACHINES)
