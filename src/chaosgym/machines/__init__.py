"""What an engineer writes down: a machine in SI units, and its reduction to the model that the kernels know."""

from typing import TYPE_CHECKING, Any

from chaosgym.machines.registry import MACHINES, register_machine

if TYPE_CHECKING:
    from chaosgym.machines.impact_beam import THESIS_IMPACT_BEAM, ImpactBeam
    from chaosgym.machines.machine import Machine
    from chaosgym.machines.slider_crank import THESIS_SLIDER_CRANK, SliderCrank

__all__ = [
    "MACHINES",
    "THESIS_IMPACT_BEAM",
    "THESIS_SLIDER_CRANK",
    "ImpactBeam",
    "Machine",
    "SliderCrank",
    "register_machine",
]


def __getattr__(name: str) -> Any:
    if name in ("ImpactBeam", "THESIS_IMPACT_BEAM"):
        from chaosgym.machines import impact_beam

        return getattr(impact_beam, name)
    if name in ("SliderCrank", "THESIS_SLIDER_CRANK"):
        from chaosgym.machines import slider_crank

        return getattr(slider_crank, name)
    if name == "Machine":
        from chaosgym.machines.machine import Machine

        return Machine
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
