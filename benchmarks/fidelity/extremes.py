"""Ends of what is admissible for each kind of machine, by the fields that they set."""

from collections.abc import Mapping
from typing import Any

from chaosgym.machines import ImpactBeam, Machine, SliderCrank
from chaosgym.machines.mechanism.machine import MechanismMachine
from chaosgym.machines.modal_machine.machine import ModalMachine

Extremes = Mapping[str, Mapping[str, Any]]

_OF_MODES: Extremes = {
    "clearance 0": {"clearance": 0.0},
    "clearance 1 m": {"clearance": 1.0},
    "no damping at all": {"damping_factor": 0.0, "contact_damping": 0.0},
    "100 times the damping": {"damping_factor": 100.0},
    "no drive": {"drive_level": 0.0},
    "1000 times the drive": {"drive_level": 1e3},
}

EXTREMES: Mapping[type[Machine], Extremes] = {
    ImpactBeam: {
        "clearance 0": {"clearance": 0.0},
        "clearance 1e-9 m": {"clearance": 1e-9},
        "clearance 1 m": {"clearance": 1.0},
        "0.01 Hz": {"excitation_frequency": 0.01},
        "1000 Hz": {"excitation_frequency": 1000.0},
        "contact stiffness 1e3 N/m": {"contact_stiffness": 1e3},
        "contact stiffness 1e9 N/m": {"contact_stiffness": 1e9},
        "contact stiffness 1e12 N/m": {"contact_stiffness": 1e12},
        "contact damping 0": {"contact_damping": 0.0},
        "contact damping 1e4 N s/m": {"contact_damping": 1e4},
        "contact damping 1e6 N s/m": {"contact_damping": 1e6},
        "damping ratio 0": {"damping_ratio": 0.0},
        "damping ratio 1": {"damping_ratio": 1.0},
        "damping ratio 100": {"damping_ratio": 100.0},
        "shaker damping 0": {"shaker_damping": 0.0},
        "shaker damping 1e3 N s/m": {"shaker_damping": 1e3},
        "shaker damping 1e6 N s/m": {"shaker_damping": 1e6},
        "no damping at all": {"damping_ratio": 0.0, "shaker_damping": 0.0, "contact_damping": 0.0},
        "force 0": {"force_amplitude": 0.0},
        "force 1e6 N": {"force_amplitude": 1e6},
    },
    SliderCrank: {
        "clearance 0": {"slider_clearance": 0.0},
        "clearance 1e-9 m": {"slider_clearance": 1e-9},
        "clearance 20 mm": {"slider_clearance": 0.02},
        "1 rpm": {"crank_speed": 1.0},
        "5000 rpm": {"crank_speed": 5000.0},
        "contact stiffness 1e3 N/m": {"contact_stiffness": 1e3},
        "contact stiffness 1e10 N/m": {"contact_stiffness": 1e10},
        "contact stiffness 1e12 N/m": {"contact_stiffness": 1e12},
        "contact damping ratio 0": {"contact_damping_ratio": 0.0},
        "contact damping ratio 1": {"contact_damping_ratio": 1.0},
        "contact damping ratio 100": {"contact_damping_ratio": 100.0},
        "damping ratio 0": {"damping_ratio": 0.0},
        "damping ratio 1": {"damping_ratio": 1.0},
        "damping ratio 100": {"damping_ratio": 100.0},
        "friction 0.5": {"friction_coefficient": 0.5},
        "Hertzian contact": {"contact_law": "hertz"},
        "gravity 100 m/s2": {"gravity": 100.0},
    },
    ModalMachine: _OF_MODES,
    MechanismMachine: {"no gravity": {"gravity_factor": 0.0}},
}


def extremes_of(machine: Machine) -> Extremes:
    """Extremes of a machine: those of its kind, or none."""
    return next((EXTREMES[kind] for kind in type(machine).__mro__ if kind in EXTREMES), {})
