"""The Impact Beam System of the thesis."""

from chaosgym.machines.impact_beam.machine import ImpactBeam

__all__ = ["ImpactBeam"]
