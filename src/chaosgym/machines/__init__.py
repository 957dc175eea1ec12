"""What an engineer writes down: a machine in SI units, and its reduction to the model that the kernels know."""

from chaosgym.machines.impact_beam import THESIS_IMPACT_BEAM, ImpactBeam
from chaosgym.machines.machine import Machine
from chaosgym.machines.slider_crank import THESIS_SLIDER_CRANK, SliderCrank

MACHINES: dict[str, type[Machine]] = {machine.name: machine for machine in (ImpactBeam, SliderCrank)}
"""Every machine by its name on the command line."""

__all__ = ["MACHINES", "THESIS_IMPACT_BEAM", "THESIS_SLIDER_CRANK", "ImpactBeam", "Machine", "SliderCrank"]
