"""One point of the exploration: a machine, and everything that is shown of it, as plain numbers and lines."""

import shlex
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.coexistence import coexistence
from chaosgym.classifier import classifier_for
from chaosgym.diagnosis import MachineDiagnosis, diagnose
from chaosgym.errors import ChaosgymError, ParameterError, SimulationError
from chaosgym.machines import FILE_ENDING, MACHINES, Machine
from chaosgym.machines.accuracy import accuracy_of
from chaosgym.machines.parameters import by_field, changes_of, parameters_of, with_settings
from chaosgym.machines.picture import Sketch
from chaosgym.plotting.labels import axis_label
from chaosgym.recordings.monitor import Monitor
from chaosgym.simulation import simulate
from chaosgym.units import as_float

LOOKING = "other motions: looking for them ..."
"""Told until the search has ended."""

SEARCHED_SECONDS = 3e-3
"""Processor time of a cycle [s] up to which the search of other motions, some 7,000 cycles, is made here."""

BUDGET = 400
"""Cycles of the diagnosis: what is sure after some hundredths of a second."""

SHOWN_CYCLES, SAMPLES = 6, 300
"""Cycles of the time history and of the phase portrait, and samples of each."""

SKETCHED, FRAMES = 2, 120
"""Last cycles in which the machine is shown moving, at most, and moments of all of them."""

DIAGRAM_POINTS, DIAGRAM_CYCLES, DIAGRAM_TRANSIENT = 140, 30, 60
"""Speeds of the orbit diagram, cycles shown of each, and cycles before them."""

MOST_SECONDS = 0.05
"""Processor time that a cycle may take [s]."""

SENSOR_ERROR, MONITORED_CYCLES = 3.0, 64
"""Largest error [N] of the monitor's sensor (thesis 3.6), and settled cycles that it sees."""


class Slider(NamedTuple):
    """A field that a slider moves, with its range; lengths are shown in mm (``factor`` 1000)."""

    field: str
    label: str
    low: float
    high: float
    factor: float


@dataclass(frozen=True)
class PointView:
    """What a point looks like.

    Attributes
    ----------
    time, displacement, velocity, force
        Of the last ``SHOWN_CYCLES`` cycles [s, m, m/s, N].
    section : (cycles, 2)
        Displacement [m] and velocity [m/s] once a cycle, settled motion.
    peaks : (cycles,)
        Peak forces [N] of the settled cycles, first side.
    room
        Displacement [m] at the lower and the upper stop.
    sketch
        The machine at ``FRAMES`` moments; None if it has no picture, or could not be followed.
    span
        Time [s] that these moments cover.
    nature
        Of the verdict; "undetermined" where the motion could not be followed.
    headline, lines
        Verdict and its evidence; the classifier; the monitor. Other motions are looked for apart (``beside_of``).
    """

    time: Array
    displacement: Array
    velocity: Array
    force: Array
    section: Array
    peaks: Array
    room: tuple[float, float]
    nature: str
    headline: str
    lines: tuple[str, ...]
    sketch: Sketch | None = None
    span: float = 0.0


def sliders_of(machine: Machine) -> list[Slider]:
    """Speed, clearance and damping of a machine: its first damping ratio, or its first damping of another kind."""
    described = parameters_of(machine)
    damping = [name for name in described if "damping" in name and not described[name].choices]
    damping.sort(key=lambda name: not name.endswith("damping_ratio"))
    fields = [machine.speed_field, machine.clearance_field, *damping[:1]]
    return [_slider(machine, field) for field in fields]


def _slider(machine: Machine, field: str) -> Slider:
    about, value = parameters_of(machine)[field], float(getattr(machine, field))
    usual = machine.usual_ranges.get(field, (0.2 * value, 5.0 * value if value else 1.0))
    low, high = max(min(usual[0], value), about.low), min(max(usual[1], value), about.high)
    label, factor = axis_label(machine, field)
    return Slider(field, label, low, high, factor)


def machine_from(name: str, settings: Mapping[str, str], served: str = "") -> Machine:
    """Machine of a deep link: fields in SI by name; what is not given is as in the registry.

    No link makes the page read a file but that of the machine ``served``.

    Raises
    ------
    ParameterError
        If the machine, a field or a value is unknown; names it.
    """
    known = list(dict.fromkeys([*MACHINES, *filter(None, [served])]))
    if name not in known:
        raise ParameterError(f"machine = {name!r} is not one of {', '.join(known)}")
    described = parameters_of(MACHINES[name])
    values: dict[str, Any] = {}
    for field, text in by_field(MACHINES[name], settings).items():
        chosen = field in described and described[field].choices
        try:
            values[field] = text if chosen else as_float(text)
        except ValueError:
            raise ParameterError(f"{field} = {text!r} is no number") from None
    return with_settings(MACHINES[name](), values)


def link_of(machine: Machine) -> str:
    """Query of the deep link of a machine."""
    from urllib.parse import urlencode

    return urlencode({"machine": machine.name, **changes_of(machine)})


def python_of(machine: Machine) -> str:
    """Lines of Python that diagnose a machine."""
    kind = type(machine)
    fields = ", ".join(f"{name}={value!r}" for name, value in changes_of(machine).items())
    if machine.name.endswith(FILE_ENDING):
        return _python("from chaosgym.machines import MACHINES", f"MACHINES[{machine.name!r}]({fields})")
    home = "chaosgym" if kind.__module__.startswith("chaosgym.") else kind.__module__
    return _python(f"from {home} import {kind.__name__}", f"{kind.__name__}({fields})")


def _python(line: str, made: str) -> str:
    return f"import chaosgym\n{line}\n\nmachine = {made}\nprint(chaosgym.diagnose(machine).words)"


def command_of(machine: Machine) -> str:
    """Command line that diagnoses a machine."""
    changes = changes_of(machine)
    settings = [part for name, value in changes.items() for part in ("--set", f"{name}={value}")]
    stated = len(machine.fidelity_ladder) < 2 or machine.rung is None or set(machine.model_fields) & set(changes)
    rung = [] if stated else ["--fidelity", str(machine.rung)]
    return shlex.join(["chaosgym", "diagnose", machine.name, *settings, *rung])


def view_of(machine: Machine) -> PointView:
    """Everything that is shown of a point; a failed simulation is shown, not raised."""
    try:
        check_cost(machine)
        verdict = diagnose(machine, budget=BUDGET)
    except (SimulationError, ParameterError) as error:
        nothing = np.zeros(0)
        shown = (nothing,) * 4
        return PointView(
            *shown, np.zeros((0, 2)), nothing, machine.room_of(), "undetermined", "can't be followed", (str(error),)
        )
    judged = verdict.judged
    cycles = min(SHOWN_CYCLES, len(judged))
    last = simulate(machine, cycles, judged.section[-cycles], samples_per_cycle=SAMPLES).of_joint(judged.joint_name)
    assert last.history is not None
    motion = last.history.reshape(-1, 3)
    sketched = min(SKETCHED, cycles)
    rows = len(motion) - sketched * SAMPLES + np.arange(FRAMES) * sketched * SAMPLES // FRAMES
    heard = simulate(machine, MONITORED_CYCLES, judged.section[-1]).peak_force[:, judged.worst_side]
    return PointView(
        time=last.time,
        displacement=motion[:, 0],
        velocity=motion[:, 1],
        force=motion[:, 2],
        section=np.column_stack([judged.displacement, judged.velocity]),
        peaks=judged.peak_force[:, judged.worst_side],
        room=machine.room_of(judged.joint),
        nature=verdict.nature,
        headline=verdict.statement.headline,
        lines=(
            *replace(verdict, searched="").statement.lines()[1:],
            _votes(verdict),
            _classified(machine),
            _watched(heard),
            *_modelled(machine),
        ),
        sketch=machine.sketch(last, rows, float(np.abs(motion[:, 2]).max()) or 1.0),
        span=sketched * machine.cycle_period,
    )


def check_cost(machine: Machine, most: float = MOST_SECONDS) -> None:
    """Refuse a machine of which a cycle takes more than ``most`` seconds of processor time: the page would not follow.

    Raises
    ------
    SimulationError
        If it does, or can't be followed.
    """
    for _ in range(2):  # the first one may compile
        began = time.thread_time()
        simulate(machine, 1)
        if (took := time.thread_time() - began) < most:
            return
    raise SimulationError(f"a cycle takes {took:.2g} s; allowed here: {most} s; `chaosgym diagnose` takes its time")


def _votes(verdict: MachineDiagnosis) -> str:
    peaks = verdict.judged.peak_force
    if not peaks.any():
        return "no contact at all: the gap is never closed"
    votes = ", ".join(f"{test.replace('_', ' ')} {vote}" for test, vote in verdict.votes.items())
    machine = verdict.judged.machine
    surfaces = zip(machine.sides, peaks.T, strict=True)
    forces = ", ".join(f"{side} {own.min():.1f} to {own.max():.1f} N" for side, own in surfaces if own.any())
    return f"peak forces {forces}; votes: {votes}"


def _classified(machine: Machine) -> str:
    """What the classifier says of the machine by the model that it was trained on."""
    try:
        classifier = classifier_for(machine)
        fields = set(machine.model_fields) & set(parameters_of(machine))
        trained = {name: getattr(classifier.machine, name) for name in fields}
        answer = classifier.classify(with_settings(machine, trained), types=False)
    except ChaosgymError as error:
        return f"classifier: {error}"
    centre = answer.centre
    if centre.nature is None:
        return f"classifier: no answer: {centre.reason}"
    how = "proven" if centre.proven else f"probability {centre.probability:.2f}"
    rung = classifier.machine.rung
    model = f", of the {rung} model" if rung and machine.rung != rung else ""
    return f"classifier: {centre.nature}{model}, {how} by {centre.stage}"


def _modelled(machine: Machine) -> tuple[str, ...]:
    """The machine's model and its estimated error here, and whether that is more than is documented."""
    accuracy = accuracy_of(machine)
    return tuple(filter(None, (accuracy.line, accuracy.warning)))


def _watched(peaks: Array) -> str:
    last = list(Monitor(SENSOR_ERROR).watch(peaks))[-1]
    does = "ALARM: irregular" if last.alarm else "no alarm"
    return f"monitor with a ±{SENSOR_ERROR:g} N sensor: {does} in {len(peaks)} cycles"


def orbit_diagram(machine: Machine, slider: Slider) -> Iterator[tuple[float, Array]]:
    """Peak forces [N] of settled cycles at one speed after the other; (speed, (cycles,)) each."""
    for speed in np.linspace(slider.low, slider.high, DIAGRAM_POINTS).tolist():
        try:
            record = simulate(machine.at(speed), DIAGRAM_CYCLES, transient=DIAGRAM_TRANSIENT)
        except SimulationError:
            continue
        yield speed, np.unique(np.round(record.peak_force[:, record.worst_side], 3))


def beside_of(machine: Machine) -> tuple[str, ...]:
    """Other motions of a machine, how far was looked, and over which speeds each motion is stable.

    Random starts, run-ups and run-downs are those of every command.

    Examples
    --------
    >>> from chaosgym.explore.point import beside_of
    >>> beside_of(chaosgym.ImpactBeam(excitation_frequency=10.0))[0][:64]
    'other motions: 48 random starts up to 10 times the motion and ru'
    """
    try:
        verdict = diagnose(machine, budget=BUDGET)
        if verdict.nature != "periodic":
            return ("other motions: looked for only beside a motion that repeats",)
        check_cost(machine, SEARCHED_SECONDS)
        beside = coexistence(machine, verdict, workers=1)
    except (ParameterError, SimulationError) as error:
        return (f"other motions: not looked for: {error}",)
    told = beside.attractors.told_of(verdict).statement.other_motions
    return (f"other motions: {told}", *beside.lines)
