"""Beams of the figures of chapters 3 and 5: clearances, lengths, and runs over one field."""

from collections.abc import Sequence
from dataclasses import replace

from chaosgym.machines import ImpactBeam
from thesis.figures.computations import Runs
from thesis.figures.panels import ParameterAxis
from thesis.scorecard.observation import THOROUGH

TINY, SMALL, LARGE = 0.015e-3, 0.03175e-3, 0.127e-3
"""Clearances [m] of figures 3.10, 3.8a and 3.8b."""

TRANSIENT, CYCLES, *_ = THOROUGH["impact-beam"]
"""Cycles in which a response settles, and those shown of it (3.5.1): as for the scorecard."""

LENGTHS = (0.279, 0.2815, 0.284)
"""Lengths [m] of table 3.1."""

LENGTH = ParameterAxis("length", "beam length [mm]", 1e3, "mm")
DAMPING = ParameterAxis("damping_ratio", "structural damping ratio [%]", 1e2, "%")


def runs(machines: Sequence[ImpactBeam], *fields: str, cycles: int = CYCLES, transient: int = TRANSIENT) -> Runs:
    """Peak forces of several beams."""
    return Runs(machines=tuple(machines), fields=fields, cycles=cycles, transient=transient)


def sweep(beam: ImpactBeam, field: str, values: Sequence[float], **options: int) -> Runs:
    """Peak forces over one field."""
    return runs([replace(beam, **{field: value}) for value in values], field, **options)  # type: ignore[arg-type]
