"""A machine that a user describes: modes or matrices, a joint with a gap, and a periodic drive."""

from chaosgym.machines.modal_machine.drive import Drive
from chaosgym.machines.modal_machine.file import read_machine
from chaosgym.machines.modal_machine.machine import ModalMachine
from chaosgym.machines.modal_machine.structure import Structure

__all__ = ["Drive", "ModalMachine", "Structure", "read_machine"]
