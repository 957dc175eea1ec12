"""Labels of axes and names of machines, which need no library of pictures."""

from pathlib import Path
from textwrap import shorten

from chaosgym.machines import FILE_ENDING, Machine
from chaosgym.machines.parameters import is_half_play, parameters_of


def axis_label(machine: Machine, name: str) -> tuple[str, float]:
    """Label of a field with its unit, millimetres for metres, and the factor that goes with it.

    Examples
    --------
    >>> axis_label(chaosgym.ImpactBeam(), "clearance")
    ('clearance, half the play [mm]', 1000.0)
    """
    unit = parameters_of(machine)[name].unit
    shown, factor = ("mm", 1e3) if unit == "m" else (unit, 1.0)
    called = name.replace("_", " ") + (", half the play" if is_half_play(machine, name) else "")
    return called + ("" if shown == "-" else f" [{shown}]"), factor


def called(machine: Machine, width: int = 60) -> str:
    """What a machine is called in a title: the title of its file, the file's name where it states none, or its name.

    Examples
    --------
    >>> called(chaosgym.ImpactBeam())
    'impact-beam'
    """
    if not machine.name.endswith(FILE_ENDING):
        return machine.name
    stated = type(machine).__doc__ or machine.name
    return Path(machine.name).stem if stated == machine.name else shorten(stated, width, placeholder=" ...")
