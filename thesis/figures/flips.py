"""Places along an axis where the nature of a response changes."""

from itertools import pairwise

from thesis.figures.computations import Data
from thesis.figures.panels import ParameterAxis


def flips(data: Data, axis: ParameterAxis, step: float) -> str:
    """Where the nature changes over one step of the axis, in words."""
    values, nature = axis.factor * data[axis.field], data["nature"]
    known = [(value, kind) for value, kind in zip(values, nature, strict=True) if kind in ("periodic", "chaotic")]
    places = [
        f"{a[0]:.5g} to {b[0]:.5g} {axis.unit} ({a[1]} to {b[1]})"
        for a, b in pairwise(known)
        if a[1] != b[1] and abs(b[0] - a[0]) <= 1.01 * step
    ]
    return "; ".join(places) if places else "nowhere"
