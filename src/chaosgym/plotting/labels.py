"""Labels of axes, which need no library of pictures."""

from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of


def axis_label(machine: Machine, name: str) -> tuple[str, float]:
    """Label of a field with its unit, millimetres for metres, and the factor that goes with it."""
    unit = parameters_of(machine)[name].unit
    shown, factor = ("mm", 1e3) if unit == "m" else (unit, 1.0)
    return name.replace("_", " ") + ("" if shown == "-" else f" [{shown}]"), factor
