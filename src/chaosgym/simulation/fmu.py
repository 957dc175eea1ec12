"""A machine as an FMU for co-simulation by FMI 2.0, which other simulators run.

pythonfmu wraps a script, which calls ``MachineInside``, and the machine's files. The FMU holds no Python: whoever runs
it needs one that can import this package.
"""

import json
import re
import subprocess
import sys
import tempfile
import uuid
import zipfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, fromstring

from chaosgym.errors import ChaosgymError, ParameterError
from chaosgym.files import first_line, write_atomically
from chaosgym.machines import FILE_ENDING, MACHINES
from chaosgym.machines.machine import Machine
from chaosgym.machines.machine_file import files_of
from chaosgym.machines.parameters import changes_of, parameters_of, with_settings
from chaosgym.numbers import whole
from chaosgym.simulation.motion_in_time import NATURES, MotionInTime
from chaosgym.version import __version__

FOLDER, ABOUT = "machine", "about.json"
"""Folder among the FMU's resources that holds the machine's files, and the file that says which machine it is."""

QUANTITIES = {"displacement": "m", "velocity": "m/s", "force": "N"}
"""What is known of a joint at each instant, and in which unit."""

SCRIPT = '''"""Entry of the FMU: all it does stands in chaosgym.simulation.fmu."""

import pythonfmu
from pythonfmu import Fmi2Slave

from chaosgym.simulation.fmu import MachineInside


class {name}(Fmi2Slave):
    """The machine of the folder beside this file."""

    def __init__(self, **keywords):
        super().__init__(**keywords)
        self.inside = MachineInside(self, pythonfmu)

    def to_xml(self, *given):
        return self.inside.described(super().to_xml(*given))

    def do_step(self, current_time, step_size):
        return self.inside.do_step(step_size)
'''


class MachineInside:
    """What runs inside an FMU.

    Parameters
    ----------
    slave
        The ``Fmi2Slave`` whose ``resources`` is the folder of the FMU's files; it is given variables.
    library
        pythonfmu, as the FMU brings it.

    Raises
    ------
    ChaosgymError
        If the machine can't be read.
    """

    def __init__(self, slave: Any, library: Any) -> None:
        self._slave, self._library = slave, library
        self._units: dict[str, str] = {}
        folder = Path(slave.resources) / FOLDER
        about = json.loads((folder / ABOUT).read_text("utf-8"))
        machine = _restored(about, folder)
        self._motion = MotionInTime(machine, about["samples"])
        slave.guid = uuid.UUID(about["guid"])
        slave.author, slave.version = "chaosgym", about["chaosgym"]
        slave.description = f"{about['title']}, by chaosgym {about['chaosgym']}"
        period = machine.cycle_period
        slave.default_experiment = library.DefaultExperiment(0.0, 100.0 * period, period)
        if about["chaosgym"] != __version__:
            slave.log(f"made by chaosgym {about['chaosgym']}; this is {__version__}")
        self._add_inputs(machine)
        self._add_outputs(machine)

    def _add_inputs(self, machine: Machine) -> None:
        about, inputs = parameters_of(machine), self._motion.inputs
        for field in machine.operating_fields:
            name, unit = "speed" if field == machine.speed_field else plain(field), about[field].unit
            self._units |= {} if unit == "-" else {name: unit}
            variable = self._library.Real(
                name,
                causality=self._library.Fmi2Causality.input,
                variability=self._library.Fmi2Variability.continuous,
                description=f"{field} [{unit}]; takes effect when a cycle begins",
                getter=lambda field=field: inputs[field],
                setter=lambda value, field=field: inputs.update({field: value}),
            )
            self._slave.register_variable(variable, nested=False)

    def _add_outputs(self, machine: Machine) -> None:
        motion, unit = self._motion, parameters_of(machine)[machine.speed_field].unit
        for side, place in machine.surfaces.items():
            about = f"{side}, in the last whole cycle"
            self._output(f"peak_force_{side}", f"largest force [N], {about}", lambda p=place: motion.peaks[p])
            self._output(f"impacts_{side}", f"contacts, {about}", lambda p=place: motion.impacts[p], "Integer")
        for row, joint in enumerate(machine.joints or ("",)):
            for column, (name, si) in enumerate(QUANTITIES.items()):
                self._output(
                    f"{joint}_{name}" if joint else name,
                    f"{name} [{si}] now, at the last of the samples of the cycle",
                    lambda r=row, c=column: motion.motion[r, c],
                )
        self._output("cycle_speed", f"speed of the cycle that runs [{unit}]", lambda: motion.speed)
        self._output("cycle_period", "duration of the cycle that runs [s]", lambda: motion.period)
        self._output("cycles", "cycles that are over", lambda: motion.cycles, "Integer")
        natures = ", ".join(f"{number} {nature}" for number, nature in enumerate(NATURES))
        self._output("nature", natures, lambda: NATURES.index(motion.verdict["nature"]), "Integer")
        repeats = "cycles after which the motion repeats, 0 if it does not"
        self._output("verdict_period", repeats, lambda: motion.verdict["period"] or 0, "Integer")
        margin = "0 at the threshold, 1 where there is no doubt"
        self._output("verdict_margin", margin, lambda: motion.verdict["margin"])

    def _output(self, name: str, about: str, getter: Any, kind: str = "Real") -> None:
        library = self._library
        if unit := re.search(r"\[(.+?)\]", about):
            self._units[plain(name)] = unit[1]
        variable = getattr(library, kind)(
            plain(name),
            causality=library.Fmi2Causality.output,
            variability=library.Fmi2Variability.discrete if kind == "Integer" else None,
            initial=library.Fmi2Initial.calculated,
            description=about,
            getter=getter,
        )
        self._slave.register_variable(variable, nested=False)

    def described(self, root: Element) -> Element:
        """Return the FMU's description with units, which names what is calculated at the start too.

        The standard asks for the latter, and pythonfmu writes neither.
        """
        units = Element("UnitDefinitions")
        for name in sorted(set(self._units.values())):
            SubElement(units, "Unit", {"name": name})
        root.insert(1 + [child.tag for child in root].index("CoSimulation"), units)
        for variable in root.iterfind("ModelVariables/ScalarVariable"):
            if (real := variable.find("Real")) is not None and variable.attrib["name"] in self._units:
                real.set("unit", self._units[variable.attrib["name"]])
        structure = root.find("ModelStructure")
        assert structure is not None
        unknowns = SubElement(structure, "InitialUnknowns")
        for unknown in structure.iterfind("Outputs/Unknown"):
            unknowns.append(Element("Unknown", unknown.attrib))
        return root

    def do_step(self, step: float) -> bool:
        """Move on by a step [s]; False, with the reason in the log and on standard error, if that is not possible."""
        try:
            self._motion.advance(step)
        except ChaosgymError as error:
            self._slave.log(first_line(error), self._library.enums.Fmi2Status.error)
            print(f"chaosgym: {first_line(error)}", file=sys.stderr)
            return False
        return True


def plain(name: str) -> str:
    """Return a name of letters, digits and underscores alone, as every simulator takes."""
    return re.sub(r"\W+", "_", name, flags=re.ASCII)


def export_fmu(machine: Machine, path: str | Path, *, samples: int = 256) -> Path:
    """Write a machine as an FMU for co-simulation by FMI 2.0.

    Its inputs are the speed and the machine's other ``operating_fields``, such as the amplitude of the force. Outputs
    are peak forces and impacts of the last whole cycle, motion and force now, and the two-step test's verdict on the
    cycles at these inputs. A step may have any length; a new input takes effect when the next cycle begins.

    Parameters
    ----------
    machine
        What runs in it: a registered one, or that of a file, which goes along with the files that it names.
    path
        Of the FMU, ``NAME.fmu``; a file that is there is replaced.
    samples
        Instants of each cycle at which displacement, velocity and force are known.

    Raises
    ------
    ParameterError
        If the path does not end in ``.fmu``, or a file of the machine lies outside its folder.
    ChaosgymError
        If pythonfmu is not installed, or fails.

    Examples
    --------
    >>> import tempfile
    >>> from chaosgym.simulation.fmu import export_fmu
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_fmu(chaosgym.ImpactBeam(), f"{folder}/beam.fmu").name
    'beam.fmu'
    """
    if find_spec("pythonfmu") is None:
        raise ChaosgymError("pythonfmu is not installed; install it with: pip install 'chaosgym[fmu]'")
    target = Path(path)
    if target.suffix != ".fmu":
        raise ParameterError(f"{target} does not end in .fmu")
    whole("samples", samples, 1, 100_000)
    with tempfile.TemporaryDirectory(prefix="chaosgym-fmu-") as temporary:
        folder = Path(temporary) / FOLDER
        folder.mkdir()
        about = _described(machine, folder) | {"samples": int(samples), "chaosgym": __version__}
        text = json.dumps(about, sort_keys=True)
        about["guid"] = str(uuid.uuid5(uuid.NAMESPACE_URL, text))
        (folder / ABOUT).write_text(json.dumps(about, indent=1), encoding="utf-8")
        name = plain(Path(machine.name).stem.title()).replace("_", "")
        name = name if name[:1].isalpha() else f"Machine{name}"
        script = Path(temporary) / f"fmu_{about['guid'].replace('-', '')}.py"
        script.write_text(SCRIPT.format(name=name), encoding="utf-8")
        built = Path(temporary) / "out.fmu"
        # in a process of its own, since the builder imports the script, and an FMU that ran here brought its pythonfmu
        ask = [sys.executable, "-m", "pythonfmu", "build", "-f", str(script), "-d", str(built), str(folder)]
        done = subprocess.run(ask, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ChaosgymError(f"pythonfmu made no FMU of {machine.name}: {done.stderr.strip().splitlines()[-1:]}")
        write_atomically(target, lambda file: file.write_bytes(built.read_bytes()))
    return target


def interface_of(path: str | Path) -> dict[str, Any]:
    """What a simulator sees of an FMU of this module: ``inputs`` and ``outputs``, what each is, and the version."""
    with zipfile.ZipFile(path) as archive:
        root = fromstring(archive.read("modelDescription.xml"))
    told: dict[str, Any] = {"inputs": {}, "outputs": {}, "chaosgym": root.get("version")}
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        told[f"{variable.get('causality')}s"][variable.get("name")] = variable.get("description")
    return told


def _described(machine: Machine, folder: Path) -> dict[str, Any]:
    """What a machine is, as plain values; its files are copied into the folder."""
    about = {"fields": changes_of(machine), "initial_state": list(machine.initial_state), "title": machine.name}
    if not machine.name.endswith(FILE_ENDING):
        return {"machine": machine.name, **about}
    main = Path(machine.name)
    for file in files_of(main):
        try:
            inside = file.resolve().relative_to(main.resolve().parent)
        except ValueError:
            raise ParameterError(
                f"{main} names {file}, which lies outside its folder; allowed: files beside it, which go along"
            ) from None
        (folder / inside).parent.mkdir(parents=True, exist_ok=True)
        (folder / inside).write_bytes(file.read_bytes())
    return {"machine": main.name, **about, "title": main.stem, "definition": machine.definition}


def _restored(about: dict[str, Any], folder: Path) -> Machine:
    name = about["machine"]
    if name.endswith(FILE_ENDING):
        name = str(folder / name)
    elif name not in MACHINES:
        raise ParameterError(f"machine {name} is not registered in this Python; {MACHINES.listed(name)}")
    machine = with_settings(MACHINES[name](), about["fields"])
    return machine.from_state(about["initial_state"])
