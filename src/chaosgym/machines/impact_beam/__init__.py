"""The Impact Beam System of the thesis."""

from chaosgym.machines.impact_beam.machine import THESIS_IMPACT_BEAM, ImpactBeam

__all__ = ["THESIS_IMPACT_BEAM", "ImpactBeam"]
