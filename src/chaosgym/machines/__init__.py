"""Machines in SI units and their reduction to models that kernels know, imported when they are asked for."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from chaosgym.errors import nearest_or

if TYPE_CHECKING:
    from chaosgym.machines.impact_beam import ImpactBeam
    from chaosgym.machines.machine import Machine
    from chaosgym.machines.slider_crank import THESIS_SLIDER_CRANK, SliderCrank

FILE_ENDING = ".toml"


class MachineRegistry(Mapping[str, "type[Machine]"]):
    """Machine classes by name.

    ``entry_points`` says where each is: module and class, as in ``"package.module:Class"``. A name that ends in
    ``.toml`` is the file of a machine, and stands for the class that it describes. ``general`` is the name of the
    machine whose records teach about machines without a classifier of their own.
    """

    def __init__(self, entry_points: Mapping[str, str], general: str) -> None:
        self.entry_points, self.general = dict(entry_points), general

    def __getitem__(self, name: str) -> "type[Machine]":
        if str(name).endswith(FILE_ENDING):
            from chaosgym.machines.machine_file import machine_class

            return machine_class(name)
        module, _, kind = self.entry_points[name].partition(":")
        found: type[Machine] = getattr(import_module(module), kind)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self.entry_points)

    def __len__(self) -> int:
        return len(self.entry_points)

    def listed(self, name: object) -> str:
        """End of a message about a name that is not known: the nearest one, or all, and that a file does too."""
        return nearest_or(f"known: {', '.join(sorted(self))}, or a file my-machine.toml", name, self)

    def class_name(self, name: str) -> str:
        """Name of a machine's class, such as ``ImpactBeam``, without importing it."""
        return self.entry_points[name].rpartition(":")[2]


MACHINES = MachineRegistry(
    {
        "impact-beam": "chaosgym.machines.impact_beam:ImpactBeam",
        "slider-crank": "chaosgym.machines.slider_crank:SliderCrank",
    },
    general="impact-beam",
)
"""A new machine of chaosgym adds one line here; one from outside calls ``register_machine``."""


def register_machine(machine: "type[Machine]") -> "type[Machine]":
    """Make a machine known to every command and task; also a class decorator."""
    MACHINES.entry_points[machine.name] = f"{machine.__module__}:{machine.__qualname__}"
    return machine


__all__ = [
    "MACHINES",
    "THESIS_SLIDER_CRANK",
    "ImpactBeam",
    "Machine",
    "SliderCrank",
    "register_machine",
]


def __getattr__(name: str) -> Any:
    if name == "ImpactBeam":
        from chaosgym.machines.impact_beam import ImpactBeam

        return ImpactBeam
    if name in ("SliderCrank", "THESIS_SLIDER_CRANK"):
        from chaosgym.machines import slider_crank

        return getattr(slider_crank, name)
    if name == "Machine":
        from chaosgym.machines.machine import Machine

        return Machine
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
