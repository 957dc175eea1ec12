"""What an engineer writes down: a machine in SI units, and its reduction to the model that the kernels know."""

from chaosgym.machines.impact_beam import THESIS_IMPACT_BEAM, ImpactBeam
from chaosgym.machines.machine import Machine

MACHINES: dict[str, type[Machine]] = {ImpactBeam.name: ImpactBeam}
"""Every machine by its name on the command line."""

__all__ = ["MACHINES", "THESIS_IMPACT_BEAM", "ImpactBeam", "Machine"]
