"""Agreement of all tests on the same random machines with a long reference, and what each costs.

The reference of a machine is what it does in the end: of the last 4000 of 10,000 cycles from rest, the last 400 repeat
within 1e-6 (periodic), or else the largest exponent exceeds three standard errors (chaotic), or lies within them
while there are only spectral lines (quasiperiodic). Transient chaos is judged by what it ends in.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from time import thread_time
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.diagnose import DEFAULT_BUDGET, diagnose
from chaosgym.diagnosis.lyapunov import Deviation
from chaosgym.diagnosis.matrix_update import Form, depends_on_configuration, matrix_update_test
from chaosgym.diagnosis.response_type import default_tolerances
from chaosgym.errors import DiagnosisError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.series.exponent import average_growth, exponent_from_series
from chaosgym.series.spectrum import power_spectrum
from chaosgym.series.stroboscopic import find_recurrence, scales, subtract_bands
from chaosgym.series.two_step import BROAD_FLOOR, two_step_test
from chaosgym.series.verdict import Nature
from chaosgym.series.zero_one import zero_one_statistic
from chaosgym.simulation import CycleRecord
from chaosgym.simulation.parallel import parallel_map

REFERENCE_CYCLES = 10_000
"""Cycles of the reference run."""

UPDATES: tuple[tuple[Form, tuple[float, float]], ...] = (
    ("literal", (5.0, 6.0)),
    ("literal", (1.0, 1.2)),
    ("attractors", (5.0, 6.0)),
    ("attractors", (1.0, 1.2)),
)
"""Forms and intervals [deg] of the Matrix Update Test, for machines whose matrices depend on their configuration."""


class RecordTest(NamedTuple):
    """One test: its name, the cycles run before and judged, and the judge of (record, logarithmic growth)."""

    name: str
    transient: int
    cycles: int
    judge: Callable[[CycleRecord, Array], Nature]


@dataclass(frozen=True)
class AgreementRow:
    """One test against the reference, over all machines whose reference is determined.

    Attributes
    ----------
    test
        Its name.
    agreement
        Share of decided points with the nature of the reference.
    false_chaos, missed_chaos
        Share of the periodic points called chaotic, and of the chaotic points called periodic.
    undecided
        Share of all points.
    cycles, seconds
        Mean cost of a point: cycles run, processor time.
    """

    test: str
    agreement: float
    false_chaos: float
    missed_chaos: float
    undecided: float
    cycles: float
    seconds: float


@dataclass(frozen=True)
class AgreementTable:
    """Agreement of all tests; ``reference`` counts natures, ``pairwise`` (tests, tests) the share of equal votes."""

    machine: str
    points: int
    reference_cycles: int
    reference: dict[str, int]
    rows: tuple[AgreementRow, ...]
    pairwise: Array

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "rows": [asdict(row) for row in self.rows], "pairwise": self.pairwise.tolist()}

    def markdown(self) -> str:
        """Return the table in Markdown."""
        counts = ", ".join(f"{count} {nature}" for nature, count in self.reference.items())
        lines = [
            f"{self.points} random points of {self.machine}; reference after {self.reference_cycles} cycles: {counts}.",
            "",
            "| test | agreement | false chaos | missed chaos | undecided | cycles | ms |",
            "|---|---|---|---|---|---|---|",
        ]
        lines += [
            f"| {row.test} | {row.agreement:.1%} | {row.false_chaos:.1%} | {row.missed_chaos:.1%} | "
            f"{row.undecided:.1%} | {row.cycles:.0f} | {1e3 * row.seconds:.0f} |"
            for row in self.rows
        ]
        return "\n".join(lines)


def random_machines(machine: Machine, count: int, seed: int = 0) -> list[Machine]:
    """Machines with speed uniform and clearance uniform in its logarithm over the usual ranges.

    Each damping is multiplied by a factor between 1/2 and 2, uniform in its logarithm.
    """
    rng = np.random.default_rng(seed)
    low, high = machine.usual_ranges[machine.speed_field]
    least, large = machine.usual_ranges[machine.clearance_field]
    small = least or 0.01 * large
    dampings = [name for name in default_tolerances(machine) if "damping" in name]
    drawn = []
    for _ in range(count):
        settings = {
            machine.speed_field: rng.uniform(low, high),
            machine.clearance_field: small * (large / small) ** rng.uniform(),
        }
        settings |= {name: getattr(machine, name) * 2.0 ** rng.uniform(-1.0, 1.0) for name in dampings}
        drawn.append(with_settings(machine, settings))
    return drawn


def _step_one(record: CycleRecord, growth: Array) -> Nature:
    """Step I by itself, as a reader of a plot would do it: peaks repeat within 1 % after up to 16 cycles."""
    peaks = record.peak_force
    if not np.any(peaks):
        return "periodic"
    scaled = peaks / np.max(peaks)
    return "periodic" if any(np.max(np.abs(scaled[k:] - scaled[:-k])) <= 0.01 for k in range(1, 17)) else "chaotic"


def _recurrence(record: CycleRecord, growth: Array) -> Nature:
    recurrence = find_recurrence(record.section / scales(record.section), 1e-5)
    return "chaotic" if recurrence.period is None else "periodic"


def _two_step(record: CycleRecord, growth: Array) -> Nature:
    return two_step_test(record).nature


def _exponent_sign(record: CycleRecord, growth: Array) -> Nature:
    return "chaotic" if np.mean(growth) > 0.0 else "periodic"


def _exponent(record: CycleRecord, growth: Array) -> Nature:
    natures: dict[int, Nature] = {1: "chaotic", -1: "periodic", 0: "undetermined"}
    return natures[average_growth(growth).sign]


def _zero_one(record: CycleRecord, growth: Array) -> Nature:
    return "chaotic" if zero_one_statistic(record.displacement) > 0.5 else "periodic"


def _spectrum(record: CycleRecord, growth: Array) -> Nature:
    x = record.displacement
    if np.ptp(x) <= 1e-8 * np.max(np.abs(x)):
        return "periodic"
    rest = subtract_bands(x)[0]
    if np.ptp(rest) <= 1e-8 * np.max(np.abs(x)):
        return "periodic"
    return "chaotic" if power_spectrum(rest).floor > BROAD_FLOOR else "periodic"


def _rosenstein(record: CycleRecord, growth: Array) -> Nature:
    try:
        exponent = exponent_from_series(record.displacement)
    except DiagnosisError:
        return "periodic"
    return "chaotic" if exponent.sign > 0 else "periodic"


TESTS = (
    RecordTest("Step I: peaks repeat within 1 %", 50, 100, _step_one),
    RecordTest("Step I: peaks repeat within 1 %", 200, 100, _step_one),
    RecordTest("recurrence of the state, 1e-5", 50, 200, _recurrence),
    RecordTest("recurrence of the state, 1e-5", 1000, 200, _recurrence),
    RecordTest("Two-Step Test", 0, 200, _two_step),
    RecordTest("Two-Step Test", 200, 200, _two_step),
    RecordTest("Two-Step Test", 1000, 1000, _two_step),
    RecordTest("exponent, sign", 50, 50, _exponent_sign),
    RecordTest("exponent, sign", 200, 200, _exponent_sign),
    RecordTest("exponent, 3 standard errors", 200, 200, _exponent),
    RecordTest("exponent, 3 standard errors", 1000, 1000, _exponent),
    RecordTest("0-1 test", 200, 500, _zero_one),
    RecordTest("0-1 test", 1000, 1000, _zero_one),
    RecordTest("spectral floor", 1000, 1000, _spectrum),
    RecordTest("Rosenstein", 1000, 1000, _rosenstein),
)
"""Every test that needs a record alone."""


class _Point(NamedTuple):
    reference: Nature
    votes: tuple[Nature, ...]
    cycles: tuple[float, ...]
    seconds: tuple[float, ...]


def reference_nature(record: CycleRecord, growth: Array) -> Nature:
    """What a long run does in the end; see the module."""
    last = record.after(len(record) - 400)
    units = np.column_stack([last.section, last.peak_force])
    if find_recurrence(units / scales(units), 1e-6, 64).period is not None:
        return "periodic"
    settled = 4 * len(record) // 10
    sign = average_growth(growth[-settled:]).sign
    if sign == 0 and two_step_test(record.after(len(record) - settled)).nature == "quasiperiodic":
        return "quasiperiodic"
    natures: dict[int, Nature] = {1: "chaotic", -1: "periodic", 0: "undetermined"}
    return natures[sign]


def agreement(
    machines: Sequence[Machine],
    *,
    tests: Sequence[RecordTest] = TESTS,
    reference_cycles: int = REFERENCE_CYCLES,
    budget: int = DEFAULT_BUDGET,
    workers: int | None = None,
    progress: bool = False,
) -> AgreementTable:
    """Compare the tests with a long reference and with each other.

    Parameters
    ----------
    machines
        Of one kind; ``random_machines`` draws some. A machine that can't be simulated is left out.
    tests
        Tests that need a record alone; those that are longer than the reference are refused.
    reference_cycles
        Length of the reference run.
    budget
        Of ``diagnose``, the last test of the table.
    workers, progress
        Number of threads; show a progress bar on standard error.
    """
    longest = max(test.transient + test.cycles for test in tests)
    if reference_cycles < max(1000, longest):
        raise DiagnosisError(
            f"reference_cycles = {reference_cycles} is out of range; allowed: {max(1000, longest)} or more"
        )

    def judge(machine: Machine) -> _Point | None:
        try:
            return _judge(machine, tests, reference_cycles, budget)
        except SimulationError:
            return None

    found = parallel_map(judge, machines, workers=workers, progress="agreement" if progress else None)
    points = [point for point in found if point is not None]
    if not points:
        raise DiagnosisError("none of the machines could be simulated")
    names = [f"{test.name}, {test.transient} + {test.cycles}" for test in tests]
    if depends_on_configuration(machines[0]):
        names += [f"Matrix Update Test, {form}, {a:g} and {b:g} deg, 200 + 100" for form, (a, b) in UPDATES]
    names.append(f"diagnose, up to {budget}")
    rows = tuple(_row(name, index, points) for index, name in enumerate(names))
    votes = np.array([point.votes for point in points])
    pairwise = np.mean(votes[:, :, None] == votes[:, None, :], axis=0)
    natures = [point.reference for point in points]
    return AgreementTable(
        machine=machines[0].name,
        points=len(points),
        reference_cycles=reference_cycles,
        reference={nature: natures.count(nature) for nature in dict.fromkeys(natures)},
        rows=rows,
        pairwise=pairwise,
    )


def _judge(machine: Machine, tests: Sequence[RecordTest], reference_cycles: int, budget: int) -> _Point:
    began = thread_time()
    record, growth = Deviation(machine).run(reference_cycles)
    per_cycle = (thread_time() - began) / reference_cycles
    votes: list[Nature] = []
    cycles, seconds = [], []
    for test in tests:
        window = slice(test.transient, test.transient + test.cycles)
        part = record.until(window.stop).after(window.start)
        began = thread_time()
        votes.append(test.judge(part, growth[window]))
        seconds.append(thread_time() - began + per_cycle * window.stop)
        cycles.append(float(window.stop))
    for form, intervals in UPDATES if depends_on_configuration(machine) else ():
        began = thread_time()
        votes.append(matrix_update_test(machine, form=form, intervals=intervals).nature)
        seconds.append(thread_time() - began)
        cycles.append(600.0)
    began = thread_time()
    verdict = diagnose(machine, budget=budget)
    seconds.append(thread_time() - began)
    cycles.append(float(verdict.evidence["cycles_used"]))
    votes.append(verdict.nature)
    return _Point(reference_nature(record, growth), tuple(votes), tuple(cycles), tuple(seconds))


def _row(name: str, index: int, points: Sequence[_Point]) -> AgreementRow:
    known = [point for point in points if point.reference != "undetermined"]
    pairs = [(point.reference, point.votes[index]) for point in known]
    decided = [(truth, vote) for truth, vote in pairs if vote != "undetermined"]

    def share(truth: Nature, vote: Nature) -> float:
        votes = [v for t, v in pairs if t == truth]
        return votes.count(vote) / len(votes) if votes else 0.0

    return AgreementRow(
        test=name,
        agreement=sum(truth == vote for truth, vote in decided) / max(1, len(decided)),
        false_chaos=share("periodic", "chaotic"),
        missed_chaos=share("chaotic", "periodic"),
        undecided=1.0 - len(decided) / max(1, len(pairs)),
        cycles=float(np.mean([point.cycles[index] for point in points])),
        seconds=float(np.mean([point.seconds[index] for point in points])),
    )
