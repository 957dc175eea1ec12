"""A machine that a user describes: modes or matrices, joints with gaps, and a periodic drive."""

from chaosgym.machines.modal_machine.drive import Drive
from chaosgym.machines.modal_machine.jointed import JointedMachine
from chaosgym.machines.modal_machine.machine import ModalMachine
from chaosgym.machines.modal_machine.machine_class import Joint, machine_with_joints
from chaosgym.machines.modal_machine.structure import Structure

__all__ = ["Drive", "Joint", "JointedMachine", "ModalMachine", "Structure", "machine_with_joints"]
