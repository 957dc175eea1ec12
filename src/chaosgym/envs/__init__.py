"""Which Gymnasium environments are there? Importing this registers them, without importing numba or matplotlib.

``SB3VecEnv``, for stable-baselines3, is imported when it is asked for.
"""

from typing import Any

from gymnasium.envs.registration import register, registry

ENVIRONMENTS = {
    "chaosgym/ImpactBeam-v0": "chaosgym.envs.impact_beam:ImpactBeamEnv",
    "chaosgym/SliderCrank-v0": "chaosgym.envs.slider_crank:SliderCrankEnv",
}
"""Entry point of each environment by id. A new machine adds one line."""

VECTOR_ENVIRONMENTS = {
    "chaosgym/ImpactBeam-v0": "chaosgym.envs.impact_beam:ImpactBeamVectorEnv",
    "chaosgym/SliderCrank-v0": "chaosgym.envs.slider_crank:SliderCrankVectorEnv",
}
"""Entry point of each native vector environment by id."""


def __getattr__(name: str) -> Any:
    if name == "SB3VecEnv":
        from chaosgym.envs.sb3 import SB3VecEnv

        return SB3VecEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register_environments() -> None:
    """Make the environments known to ``gymnasium.make``; calling it again does nothing."""
    for name, entry_point in ENVIRONMENTS.items():
        if name not in registry:
            register(id=name, entry_point=entry_point, vector_entry_point=VECTOR_ENVIRONMENTS[name])


register_environments()
