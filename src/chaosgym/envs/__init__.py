"""Which Gymnasium environments are there? Importing this registers them, without importing numba or matplotlib.

``SB3VecEnv``, for stable-baselines3, is imported when it is asked for.
"""

from typing import Any

from gymnasium.envs.registration import register, registry

MACHINES = {"ImpactBeam": "chaosgym.envs.impact_beam", "SliderCrank": "chaosgym.envs.slider_crank"}
"""Module of each machine's environment. A new machine adds one line."""

TASKS: dict[str, dict[str, Any]] = {
    "": {},
    "Tolerance": {"pool": "training"},
    "Wear": {"pool": "training", "wear": True},
}
"""Keywords of each task: the nominal machine, one drawn within tolerances, one whose clearance grows."""

ENVIRONMENTS = tuple(f"chaosgym/{machine}{task}-v0" for machine in MACHINES for task in TASKS)
"""Their ids."""


def __getattr__(name: str) -> Any:
    if name == "SB3VecEnv":
        from chaosgym.envs.sb3 import SB3VecEnv

        return SB3VecEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register_environments() -> None:
    """Make the environments known to ``gymnasium.make``; calling it again does nothing."""
    for machine, module in MACHINES.items():
        for task, keywords in TASKS.items():
            name = f"chaosgym/{machine}{task}-v0"
            if name not in registry:
                register(
                    id=name,
                    entry_point=f"{module}:{machine}Env",
                    vector_entry_point=f"{module}:{machine}VectorEnv",
                    kwargs=keywords,
                )


register_environments()
