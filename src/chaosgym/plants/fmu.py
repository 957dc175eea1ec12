"""A plant of another program, in an FMU for co-simulation by FMI 2.0 or 3.0.

An FMU is a program of its author. It is loaded into a process of its own, so that a crash or an endless step of it ends
in an error here. That process is no sandbox: it has the rights of whoever runs it. Reading the description alone, which
the constructor does, runs nothing of it.
"""

import json
import math
import re
import shutil
import subprocess
import sys
import tempfile
import weakref
import zipfile
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from chaosgym.errors import ChaosgymError, ParameterError, nearest_or
from chaosgym.files import first_line
from chaosgym.numbers import number, whole
from chaosgym.plants.lines import ANSWER_SECONDS, Answers

LARGEST, MOST = 1_000_000_000, 100_000
"""Bytes that an FMU may have unpacked, and files."""

DESCRIPTION, HEAD = "modelDescription.xml", 10_000
"""File of an FMU that describes it, and bytes within which its version stands."""

PRINTED = "printed.txt"
"""File beside the unpacked FMU that holds what its process prints."""

PER_TURN: Mapping[str, float] = {
    "Hz": 1.0,
    "1/s": 1.0,
    "rpm": 60.0,
    "1/min": 60.0,
    "rev/min": 60.0,
    "rad/s": 2.0 * math.pi,
    "deg/s": 360.0,
}
"""Value of one turn a second in each unit of speed."""

TYPES = {"Real": float, "Float64": float, "Integer": int, "Int32": int, "Boolean": bool, "String": str}
"""Types of variables whose start can be set, and of the values that they take."""


class FmuPlant:
    """A plant in an FMU.

    Parameters
    ----------
    path
        Of the FMU. Its binary for this computer is run, with your rights: load no FMU whose author you don't trust.
    input
        Its variable that is the speed.
    output
        Its variable that is the contact force [N], at each instant; of two stops one whose sign tells them apart, or
        two variables, the force on each.
    measured
        Its variable that is the measured speed, if there is one.
    start
        Values that variables of it begin with, by name.
    unit
        Of the speeds that ``run`` is called with: Hz or rpm. A cycle is a turn.
    input_unit
        Of the input and of ``measured``; by default that which the FMU declares, and ``unit`` if it declares none.
    samples
        Steps of a cycle. What is shorter than one is not seen.
    step
        Length of a step [s] instead, for an FMU that takes no other. A cycle then ends at the nearest step.
    threshold
        Force [N] above which there is contact.
    seconds
        For which an answer of the FMU is waited for.

    Raises
    ------
    ParameterError
        If it can't be read as an FMU, is none for co-simulation by FMI 2.0 or 3.0, has no binary for this computer or
        no such variable, or an argument is out of range. Later, if the FMU fails, ends or does not answer.
    ChaosgymError
        If FMPy is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from chaosgym.plants.fmu import FmuPlant
    >>> from chaosgym.simulation.fmu import export_fmu
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = export_fmu(chaosgym.ImpactBeam(), f"{folder}/beam.fmu")
    ...     plant = FmuPlant(path, input="speed", output="force")
    ...     plant.reset()
    ...     peaks = plant.run(20.0, 3)["peaks"]  # [N], the largest and the smallest force of each cycle
    ...     plant.stop()
    >>> len(peaks)
    3
    """

    def __init__(
        self,
        path: str | Path,
        *,
        input: str,
        output: str | Sequence[str],
        measured: str | None = None,
        start: Mapping[str, Any] | None = None,
        unit: str = "Hz",
        input_unit: str | None = None,
        samples: int = 200,
        step: float | None = None,
        threshold: float = 0.0,
        seconds: float = ANSWER_SECONDS,
    ) -> None:
        samples = whole("samples", samples, 1, 100_000)
        if step is not None:
            number("step", step, 0.0, unit="s", inside=True)
        number("threshold", threshold, -math.inf)
        self._path, self._seconds = Path(path), number("seconds", seconds, 0.0, unit="s", inside=True)
        self._process: subprocess.Popen[str] | None = None
        about = described(self._path)
        self.tool = about.generationTool or "an unnamed tool"
        outputs = [output] if isinstance(output, str) else list(output)
        if not 1 <= len(outputs) <= 2:
            raise ParameterError(f"output = {output!r} is not usable; allowed: one variable, or two, of two stops")
        if step is None and not about.coSimulation.canHandleVariableCommunicationStepSize:
            raise ParameterError(
                f"{path} takes steps of one length alone, and a cycle of another speed has another; give step=... [s]"
            )
        variables = {each.name: each for each in about.modelVariables}
        self._samples, self._step = samples, step
        self._turn = _per_turn("unit", unit)
        driven = self._real(variables, "input", input)
        self._input_turn = self._unit_of(about, driven, input_unit, unit)
        sensed = [self._real(variables, "output", name) for name in outputs]
        speeds = [] if measured is None else [self._real(variables, "measured", measured)]
        self._request = {
            "version": about.fmiVersion[0],
            "token": about.guid,
            "identifier": about.coSimulation.modelIdentifier,
            "input": driven.valueReference,
            "outputs": [each.valueReference for each in sensed],
            "measured": [each.valueReference for each in speeds],
            "start": [self._begins(variables, name, value) for name, value in (start or {}).items()],
            "threshold": float(threshold),
        }
        self._once = about.coSimulation.canBeInstantiatedOnlyOncePerProcess
        self._folder: Path | None = None

    @property
    def warning(self) -> str:
        """What must be known before it is loaded, in one line."""
        return f"{self._path} is a program by {self.tool}; it runs here with your rights, in a process of its own"

    def reset(self) -> None:
        """Begin anew, at the FMU's own initial state."""
        if self._once:
            self.close()
        self.stop()
        if self._process is None:
            self._begin()
        assert self._folder is not None
        self._ask("reset", {**self._request, "folder": str(self._folder)})

    def run(self, speed: float, cycles: int) -> dict[str, Any]:
        """Run for some cycles at a speed.

        Returns
        -------
        dict
            ``peaks``, (cycles, 2), the largest and the smallest force of each cycle [N]; ``impacts`` and ``bouncing``
            by the force at the steps; ``speed``, if one is measured.
        """
        if not 0.0 < speed < math.inf:
            raise ParameterError(f"speed = {speed!r} is out of range; allowed: above 0, finite")
        turns = speed / self._turn
        period = 1.0 / turns
        if self._step is not None and self._step > 0.5 * period:
            raise ParameterError(
                f"step = {self._step:g} s is too long for a cycle of {period:g} s; allowed: up to half of it"
            )
        step = period / self._samples if self._step is None else self._step
        told = self._ask("run", [turns * self._input_turn, period, cycles, step])
        if "speed" in told:
            told["speed"] *= self._turn / self._input_turn
        return told

    def stop(self) -> None:
        """Let the FMU end; its process waits for another ``reset``."""
        if self._process is not None:
            with suppress(ParameterError):  # it has ended, then
                self._ask("end", None)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._end()
            self._process = None

    def _begin(self) -> None:
        """Unpack the FMU, if it is not, and start the process."""
        if self._folder is None:
            import fmpy

            self._folder = Path(tempfile.mkdtemp(prefix="chaosgym-fmu-"))
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
            try:
                fmpy.extract(str(self._path), str(self._folder))
            except Exception as error:
                raise ParameterError(f"{self._path} can't be unpacked: {first_line(error)}") from error
        with open(self._folder / PRINTED, "w", encoding="utf-8") as printed:
            process = subprocess.Popen(
                [sys.executable, "-P", str(Path(__file__).with_name("fmu_process.py"))],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=printed,
                text=True,
                encoding="utf-8",
            )
        assert process.stdout is not None
        self._answers, self._process = Answers(process.stdout, self._seconds), process
        self._end = weakref.finalize(self, _close, process)

    def _ask(self, word: str, given: Any) -> dict[str, Any]:
        """Request something of the process, which Ctrl-C ends: its answer would be taken for that to the next one."""
        if self._process is None:
            raise ParameterError(f"{self._path} does not run; call reset() first")
        stdin = self._process.stdin
        try:
            print(json.dumps([word, given]), file=stdin, flush=True)
            line = self._answers.next()
        except OSError:
            line = ""
        except KeyboardInterrupt:
            self.close()
            raise
        if line is None:
            self.close()
            raise ParameterError(f"{self._path} gave no answer within {self._seconds:g} s, and was ended")
        if not line:
            code = self._process.wait()
            self.close()
            how = f"signal {-code}" if code < 0 else f"exit code {code}"
            raise ParameterError(f"{self._path} ended its process ({how}){self._last_words()}")
        told: dict[str, Any] = json.loads(line)
        if "error" in told:
            raise ParameterError(f"{self._path}: {told['error'].splitlines()[0][:200]}{self._last_words()}")
        return told

    def _last_words(self) -> str:
        """Last line that the process printed, for an error."""
        assert self._folder is not None
        with open(self._folder / PRINTED, encoding="utf-8", errors="replace") as printed:
            last = deque((line.strip() for line in printed if line.strip()), maxlen=1)
        return f"; it printed: {last[0][:200]}" if last else ""

    def _real(self, variables: Mapping[str, Any], what: str, name: str) -> Any:
        """Variable of a name, which is one real number."""
        if name not in variables:
            wanted = {"input": "input", "measured": "output"}.get(what, "output")
            there = [each.name for each in variables.values() if each.causality == wanted]
            hint = nearest_or(f"its {wanted}s: {', '.join(there[:12]) or 'none'}", name, there)
            raise ParameterError(f"{what} = {name!r} is no variable of {self._path}; {hint}")
        variable = variables[name]
        if variable.type not in ("Real", "Float64") or variable.dimensions:
            kind = f"an array of {variable.type}" if variable.dimensions else f"of type {variable.type}"
            raise ParameterError(f"{what} = {name!r} is {kind}; allowed: one real number")
        settable = variable.causality == "input" or (
            variable.causality == "parameter" and variable.variability == "tunable"
        )
        if what == "input" and not settable:
            raise ParameterError(
                f"input = {name!r} is {variable.variability or ''} {variable.causality or 'local'}".replace("  ", " ")
                + "; allowed: an input, or a tunable parameter"
            )
        return variable

    def _unit_of(self, about: Any, variable: Any, given: str | None, unit: str) -> float:
        """Value of one turn a second in the unit of the input."""
        if given is not None:
            return _per_turn("input_unit", given)
        declared = variable.unit or getattr(variable.declaredType, "unit", None)
        if declared is None:
            return _per_turn("unit", unit)
        if declared not in PER_TURN:
            raise ParameterError(
                f"input {variable.name} has the unit {declared!r}; allowed: {', '.join(PER_TURN)}, or input_unit=..."
            )
        return PER_TURN[declared]

    def _begins(self, variables: Mapping[str, Any], name: str, value: Any) -> tuple[str, int, Any]:
        """Type, reference and value of a variable that begins with another value than its own."""
        if name not in variables:
            raise ParameterError(f"start has {name!r}, which is no variable of {self._path}")
        kind = variables[name].type
        number = isinstance(value, int | float) and not isinstance(value, bool)
        wanted = TYPES.get(kind, ())
        if not (number if wanted is float else wanted and type(value) is wanted):
            raise ParameterError(f"start[{name!r}] = {value!r} is not usable; the variable is of type {kind}")
        return kind, variables[name].valueReference, value


def described(path: Path) -> Any:
    """Description of an FMU for co-simulation that this computer can run, by FMPy; nothing of it is run.

    Raises
    ------
    ParameterError
        If it is none, or another one.
    ChaosgymError
        If FMPy is not installed.
    """
    if find_spec("fmpy") is None:
        raise ChaosgymError("FMPy is not installed; install it with: pip install 'chaosgym[fmu]'")
    import fmpy

    try:
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            size = sum(member.file_size for member in members)
            if size > LARGEST or len(members) > MOST:
                raise ParameterError(
                    f"{path} has {size} bytes in {len(members)} files, unpacked; allowed: up to {LARGEST} in {MOST}"
                )
            with archive.open(DESCRIPTION) as description:
                version = re.search(rb"fmiVersion\s*=\s*[\"']([\w.]*)", description.read(HEAD))
            if version and not version[1].startswith((b"2.", b"3.")):
                raise ParameterError(f"{path} is of FMI {version[1].decode()}; allowed: 2.0, 3.0")
            about = fmpy.read_model_description(file, validate=False)
    except ParameterError:
        raise
    except OSError as error:
        raise ParameterError(f"{path} can't be read: {error.strerror or first_line(error)}") from None
    except zipfile.BadZipFile as error:
        raise ParameterError(f"{path} is no FMU: {first_line(error)}") from None
    except Exception as error:  # of lxml, and of what FMPy makes of it
        told = " ".join(str(error).split())[:200] or type(error).__name__
        raise ParameterError(f"{path} is no FMU that FMPy can read: {told}") from None
    if about.coSimulation is None:
        raise ParameterError(f"{path} is an FMU for model exchange alone; allowed: one for co-simulation")
    identifier = about.coSimulation.modelIdentifier
    place = fmpy.platform_tuple if about.fmiVersion.startswith("3.") else fmpy.platform
    binary = f"binaries/{place}/{identifier}{fmpy.sharedLibraryExtension}"
    names = {member.filename for member in members}
    if binary not in names:
        others = sorted({name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1})
        hint = "; `fmpy compile` makes one of its sources" if any(name.startswith("sources/") for name in names) else ""
        raise ParameterError(
            f"{path} has binaries for {', '.join(others) or 'no computer'}; allowed: {place}, this one{hint}"
        )
    return about


def _per_turn(what: str, unit: str) -> float:
    if unit not in PER_TURN:
        raise ParameterError(f"{what} = {unit!r} is not one of {', '.join(PER_TURN)}")
    return PER_TURN[unit]


def _close(process: "subprocess.Popen[str]") -> None:
    """End a process that may have ended."""
    if process.poll() is None:
        process.kill()
        process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):
                stream.close()
