"""chaosgym: machines with clearance that rattle, bounce and turn chaotic.

    import chaosgym
    record = chaosgym.simulate(chaosgym.ImpactBeam(excitation_frequency=19.0), cycles=200, transient=200)
    chaosgym.two_step_test(record).nature

Importing this package registers its Gymnasium environments, as soon as gymnasium is imported; the rest is loaded when
it is used.
"""

import sys
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from chaosgym.version import __version__

if TYPE_CHECKING:
    from chaosgym.branches.diagram_search import follow
    from chaosgym.classifier import MachineClassifier, ResponseClassifier, classifier_for, default_classifier
    from chaosgym.control.evaluation import evaluate
    from chaosgym.control.operator import Operator
    from chaosgym.diagnosis import diagnose, response_map, response_type
    from chaosgym.diagnosis.step_check import step_check
    from chaosgym.errors import ChaosgymError, ParameterError, SimulationError
    from chaosgym.machines import THESIS_SLIDER_CRANK, ImpactBeam, SliderCrank
    from chaosgym.machines.accuracy import accuracy_of
    from chaosgym.machines.machine_file import read_machine
    from chaosgym.machines.modal_machine import Drive, Joint, ModalMachine, Structure, machine_with_joints
    from chaosgym.plants.fmu import FmuPlant
    from chaosgym.recordings.judge import judge_peaks
    from chaosgym.recordings.monitor import Monitor
    from chaosgym.recordings.read import read_recording
    from chaosgym.series import Diagnosis, two_step_test
    from chaosgym.simulation import CycleRecord, ExactEvents, RungeKutta4, simulate
    from chaosgym.simulation.parallel import simulate_many
    from chaosgym.sweeps import Axis, SweepPlan, read_sweep, run_sweep

_HOME = {
    "chaosgym.classifier": ("MachineClassifier", "ResponseClassifier", "classifier_for", "default_classifier"),
    "chaosgym.control.evaluation": ("evaluate",),
    "chaosgym.control.operator": ("Operator",),
    "chaosgym.diagnosis": ("diagnose", "response_map", "response_type"),
    "chaosgym.branches.diagram_search": ("follow",),
    "chaosgym.plants.fmu": ("FmuPlant",),
    "chaosgym.recordings.judge": ("judge_peaks",),
    "chaosgym.diagnosis.step_check": ("step_check",),
    "chaosgym.errors": ("ChaosgymError", "ParameterError", "SimulationError"),
    "chaosgym.machines": ("THESIS_SLIDER_CRANK", "ImpactBeam", "SliderCrank"),
    "chaosgym.machines.accuracy": ("accuracy_of",),
    "chaosgym.machines.machine_file": ("read_machine",),
    "chaosgym.machines.modal_machine": (
        "Drive",
        "Joint",
        "ModalMachine",
        "Structure",
        "machine_with_joints",
    ),
    "chaosgym.recordings.monitor": ("Monitor",),
    "chaosgym.recordings.read": ("read_recording",),
    "chaosgym.series": ("Diagnosis", "two_step_test"),
    "chaosgym.simulation": ("CycleRecord", "ExactEvents", "RungeKutta4", "simulate"),
    "chaosgym.simulation.parallel": ("simulate_many",),
    "chaosgym.sweeps": ("Axis", "SweepPlan", "read_sweep", "run_sweep"),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "THESIS_SLIDER_CRANK",
    "Axis",
    "ChaosgymError",
    "CycleRecord",
    "Diagnosis",
    "Drive",
    "ExactEvents",
    "FmuPlant",
    "ImpactBeam",
    "Joint",
    "MachineClassifier",
    "ModalMachine",
    "Monitor",
    "Operator",
    "ParameterError",
    "ResponseClassifier",
    "RungeKutta4",
    "SimulationError",
    "SliderCrank",
    "Structure",
    "SweepPlan",
    "__version__",
    "accuracy_of",
    "classifier_for",
    "default_classifier",
    "diagnose",
    "evaluate",
    "follow",
    "judge_peaks",
    "machine_with_joints",
    "read_machine",
    "read_recording",
    "read_sweep",
    "response_map",
    "response_type",
    "run_sweep",
    "simulate",
    "simulate_many",
    "step_check",
    "two_step_test",
]


def __getattr__(name: str) -> Any:
    if name == "envs":
        return import_module("chaosgym.envs")
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'chaosgym' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULE_OF})


class _AfterGymnasium(MetaPathFinder):
    """Registers the environments once gymnasium is imported: most commands need neither, and gymnasium takes long."""

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """Return the spec of gymnasium with a loader that registers the environments in the end."""
        if fullname != "gymnasium":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(fullname)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_register(module: Any) -> None:
            execute(module)
            import_module("chaosgym.envs")

        spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec


if "gymnasium" in sys.modules:
    import_module("chaosgym.envs")
else:
    sys.meta_path.insert(0, _AfterGymnasium())
