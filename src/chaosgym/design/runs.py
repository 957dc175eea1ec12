"""Settled runs of one machine, or of a series built to its tolerances."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.design.fatigue import equivalent_force
from chaosgym.design.statistics import convergence
from chaosgym.diagnosis import Neighbour, Tolerance, diagnose
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.rating_life import LIFE_EXPONENT
from chaosgym.series import Nature
from chaosgym.simulation import MotionState, rest_state, simulate
from chaosgym.simulation.parallel import parallel_map

SERIES_CYCLES = 200
"""Cycles recorded of a machine of a series whose response does not repeat."""

DIAGNOSIS_BUDGET = 400
"""Cycles that the diagnosis of one machine of a series may take."""

RETRY = 8
"""Budgets that a machine may take which is undetermined after one."""

NOMINAL_BUDGET = 1600
"""Cycles that the diagnosis of the nominal machine may take."""

LONGEST_RUN = 12_800
"""Cycles after which statistics that have not converged are given up."""


def worse_side(peaks: Array, exponent: float = LIFE_EXPONENT) -> Array:
    """Peaks (cycles,) of the surface that fatigues faster, of those of all surfaces (cycles, sides)."""
    damage = [equivalent_force(column, exponent) for column in peaks.T]
    return np.ascontiguousarray(peaks[:, int(np.argmax(damage))])


@dataclass(frozen=True)
class SettledRun:
    """Settled response of one machine.

    Attributes
    ----------
    machine
        What was run.
    nature
        By the Two-Step Test.
    period
        Cycles after which it repeats; None if it does not.
    reason
        One sentence for people.
    peaks : (cycles, sides)
        Peak force of each cycle [N]: one period, or a record long enough for statistics.
    final_state
        From which the settled response goes on.
    """

    machine: Machine
    nature: Nature
    period: int | None
    reason: str
    peaks: Array = field(repr=False)
    final_state: MotionState = field(repr=False)

    def worse_side(self, exponent: float = LIFE_EXPONENT) -> Array:
        """Peaks (cycles,) of the surface that fatigues faster."""
        return worse_side(self.peaks, exponent)

    @property
    def largest_peak(self) -> float:
        """Largest peak force of any surface [N]."""
        return float(np.max(self.peaks))


def settled_run(
    machine: Machine,
    *,
    verdict: MachineDiagnosis | None = None,
    until_converged: bool = False,
    budget: int = DIAGNOSIS_BUDGET,
) -> SettledRun:
    """Run a machine until it has settled, and record its peak forces: a period, or ``SERIES_CYCLES``.

    Parameters
    ----------
    machine
        What to run.
    verdict
        On the machine from rest, if it is known already.
    until_converged
        Go on, doubling the record, until mean and deviation have converged on the worse surface.
    budget
        Cycles that the diagnosis may take; eight times as many where it stays undetermined.

    Raises
    ------
    SimulationError
        If the run can't be finished.
    """
    verdict = verdict or diagnose(machine, budget=budget)
    if verdict.nature == "undetermined":
        verdict = diagnose(machine, budget=RETRY * budget)
    state = MotionState(np.asarray(verdict.evidence["final_state"]), rest_state(machine).bouncing)
    repeats = verdict.nature == "periodic" and verdict.period is not None
    record = simulate(machine, verdict.period if repeats and verdict.period else SERIES_CYCLES, state)
    run = SettledRun(
        machine,
        verdict.nature,
        verdict.period if repeats else None,
        verdict.reason,
        record.peak_force.copy(),
        record.final_state,
    )
    while until_converged and not repeats and len(record) < LONGEST_RUN:
        if convergence(run.worse_side()).converged:
            break
        record = record.followed_by(simulate(machine, len(record), record.final_state))
        run = replace(run, peaks=record.peak_force.copy(), final_state=record.final_state)
    return run


@dataclass(frozen=True)
class MachineSeries:
    """Machines built to the tolerances.

    Attributes
    ----------
    parameters
        Names of the toleranced fields.
    shares : (machines, parameters)
        Deviation of each machine from nominal, in tolerances, -1 to 1.
    runs
        What each machine does.
    """

    parameters: tuple[str, ...]
    shares: Array
    runs: tuple[SettledRun, ...]

    @property
    def told(self) -> str:
        """How many of its machines are of each nature, for people."""
        counts = Counter(run.nature for run in self.runs).most_common()
        natures = ", ".join(f"{'all' if n == len(self.runs) else n} {nature}" for nature, n in counts) or "none"
        begun = self.runs[0].machine.begins_from() if self.runs else "rest"
        return f"{len(self.runs)} machines within the tolerances, each run from {begun}: {natures}"

    @property
    def built(self) -> tuple[Neighbour, ...]:
        """Deviations, nature and largest peak of each machine."""
        return tuple(
            Neighbour(dict(zip(self.parameters, row.tolist(), strict=True)), run.nature, run.largest_peak)
            for row, run in zip(self.shares, self.runs, strict=True)
        )


def build_series(
    machine: Machine,
    tolerances: Mapping[str, Tolerance],
    size: int,
    *,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> MachineSeries:
    """Run machines whose parameters deviate together, spread evenly over the tolerances by a Sobol sequence.

    Parameters
    ----------
    machine
        The nominal machine, which is not part of the series.
    tolerances
        By field; none gives an empty series.
    size
        Number of machines.
    seed
        Of the sequence.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ParameterError
        If a tolerance names no field, or leads out of its range.
    """
    names = tuple(tolerances)
    if not names or size == 0:
        return MachineSeries(names, np.empty((0, len(names))), ())
    shares = sobol_shares(len(names), size, seed)
    machines = [deviating(machine, tolerances, row) for row in shares]
    runs = parallel_map(settled_run, machines, workers=workers, progress="machines in tolerance" if progress else None)
    return MachineSeries(names, shares, tuple(runs))


def sobol_shares(dimensions: int, size: int, seed: int) -> Array:
    """Deviations (size, dimensions) of machines that lie evenly in their tolerances, -1 to 1."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
    return np.asarray(2.0 * sequence.random_base2(int(np.ceil(np.log2(size))))[:size] - 1.0)


def deviating(machine: Machine, tolerances: Mapping[str, Tolerance], shares: Sequence[float] | Array) -> Machine:
    """Build the machine whose parameters deviate by shares of their tolerances."""
    settings = {
        name: tolerance.at(getattr(machine, name), float(share))
        for (name, tolerance), share in zip(tolerances.items(), shares, strict=True)
    }
    return with_settings(machine, settings)
