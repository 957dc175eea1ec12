"""Comparison with Exudyn: cycles a second of both programs, and whether both reach the same verdicts.

Cycles per second of processor time, on one thread, without recording; beside them how often the response is judged
right: periodic with the right period, or not. Both start from rest and are judged by the same rule after as many
cycles; right is what refined exact events show of a much longer run, so that this package can be wrong too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.performance.exudyn_machines import ExudynSetting, run_in_exudyn
from benchmarks.performance.timing import processor_seconds
from chaosgym import read_machine
from chaosgym.arrays import Array
from chaosgym.envs.exudyn_beam import load_exudyn
from chaosgym.machines import ImpactBeam, Machine, SliderCrank
from chaosgym.machines.integrators import Integrator
from chaosgym.machines.mechanism.machine import MechanismMachine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import ExactEvents, simulate

LONGEST_PERIOD = 8
"""Longest period, in cycles, that counts as periodic."""

FOUR_BAR = Path(__file__).parents[2] / "docs" / "machines" / "four-bar-akhadkar.toml"


@dataclass(frozen=True)
class Contest:
    """What is run in both simulators.

    Attributes
    ----------
    machine, speeds
        The machine, at each of some speeds in the unit of its speed field.
    settings
        Of Exudyn.
    cycles, judged, timed, reference_cycles
        Cycles from rest of a run, how many at its end are judged, how many of its first are timed, and cycles of the
        run that shows what is right.
    repeatability
        Largest deviation [N] at which two peak forces count as equal.
    goal
        How many times faster this package is meant to be.
    """

    machine: Machine
    speeds: tuple[float, ...]
    settings: tuple[ExudynSetting, ...]
    cycles: int
    judged: int
    timed: int
    reference_cycles: int
    repeatability: float
    goal: float

    def machines(self) -> list[Machine]:
        """The machine at every speed."""
        return [self.machine.at(speed) for speed in self.speeds]


CONTESTS = (
    Contest(
        machine=ImpactBeam(n_modes=5, fitted_modes=0, clearance=0.127e-3),
        speeds=tuple(float(frequency) for frequency in range(8, 31)),
        settings=(
            ExudynSetting("GeneralizedAlpha", "stop", 1e-5),
            ExudynSetting("GeneralizedAlpha", "stop", 1e-5, 1e-4),
            ExudynSetting("RK44", "law", 1e-5),
            ExudynSetting("RK44", "law", 2e-5),
        ),
        cycles=150,
        judged=50,
        timed=20,
        reference_cycles=600,
        repeatability=0.5,
        goal=300.0,
    ),
    Contest(
        machine=SliderCrank(n_modes=3, fitted_modes=0, matrix_update_interval=1.0),
        speeds=(100.0, 150.0, 200.0, 250.0),
        settings=(
            ExudynSetting("TrapezoidalIndex2", "stop", 1e-5, 1e-4),
            ExudynSetting("TrapezoidalIndex2", "stop", 2e-5, 1e-4),
        ),
        cycles=24,
        judged=16,
        timed=3,
        reference_cycles=200,
        repeatability=0.5,
        goal=750.0,
    ),
    Contest(
        machine=with_settings(read_machine(FOUR_BAR), {"knee_damping": 60.0}),
        speeds=(60.0, 90.0, 120.0, 150.0, 180.0, 210.0, 240.0),
        settings=(
            ExudynSetting("TrapezoidalIndex2", "law", 2e-5),
            ExudynSetting("TrapezoidalIndex2", "law", 1e-4),
        ),
        cycles=60,
        judged=24,
        timed=5,
        reference_cycles=400,
        repeatability=0.5,
        goal=100.0,
    ),
)
"""The crank is dear in Exudyn, so it gets fewer speeds and cycles. The four-bar's pin is damped less than in its file,
so that periodic and chaotic speeds are mixed."""


def period_of(peaks: Array, repeatability: float) -> int:
    """Number of cycles after which peak forces repeat, up to ``LONGEST_PERIOD``; 0 if they do not."""
    for period in range(1, LONGEST_PERIOD + 1):
        if np.abs(peaks[period:] - peaks[:-period]).max() <= repeatability:
            return period
    return 0


def against_exudyn(
    contests: Sequence[Contest] = CONTESTS, repeats: int = 5, *, progress: bool = False
) -> list[dict[str, Any]]:
    """Run every contest.

    Returns
    -------
    list of dict
        One for each setting of Exudyn: ``machine``, ``setting``, both ``cycles_per_processor_second``, their ``ratio``
        and its ``goal``; of how many ``speeds`` both have the ``right_class`` and the ``right_period``, and the speeds
        at which each is ``wrong_at``; ``mean_peak_force`` [N] of the judged cycles of both.

    Raises
    ------
    ChaosgymError
        If Exudyn is not installed.
    """
    load_exudyn()
    runs = sum(len(contest.settings) * len(contest.speeds) for contest in contests)
    rows = []
    with tqdm(total=runs, desc="exudyn", disable=not progress) as bar:
        for contest in contests:
            own = [_peaks(machine, contest.cycles)[-contest.judged :] for machine in contest.machines()]
            right = [_right_period(contest, machine) for machine in contest.machines()]
            for setting in contest.settings:
                theirs, rate, their_rate = _run_setting(contest, setting, repeats, bar)
                sides = {"chaosgym": _score(contest, own, right), "exudyn": _score(contest, theirs, right)}
                rows.append(
                    {
                        "machine": contest.machine.name,
                        "setting": str(setting),
                        "cycles_per_processor_second": {"chaosgym": rate, "exudyn": their_rate},
                        "ratio": rate / their_rate,
                        "goal": contest.goal,
                        "speeds": len(contest.speeds),
                        **{name: {side: sides[side][name] for side in sides} for name in sides["exudyn"]},
                    }
                )
    return rows


def _peaks(machine: Machine, cycles: int, integrator: Integrator | None = None) -> Array:
    """Peak force of each cycle on the first surface, or on a pin, as ``run_in_exudyn`` gives it."""
    peaks = simulate(machine, cycles, integrator=integrator).peak_force
    return peaks.max(axis=1) if isinstance(machine, MechanismMachine) else peaks[:, 0]


def _right_period(contest: Contest, machine: Machine) -> int:
    peaks = _peaks(machine, contest.reference_cycles, ExactEvents().refined())
    return period_of(peaks[-contest.judged :], contest.repeatability)


def _run_setting(contest: Contest, setting: ExudynSetting, repeats: int, bar: Any) -> tuple[list[Array], float, float]:
    """Judged peak forces at each speed, and cycles per second of processor time from rest over all speeds.

    The rates are of this package and of Exudyn. At each speed they take turns, so that both meet the same other work.
    """
    own = theirs = 0.0
    judged = []
    for machine in contest.machines():
        timed = partial(simulate, machine, contest.timed)
        times = [processor_seconds(timed) for _ in range(repeats)]
        theirs += run_in_exudyn(machine, contest.timed, setting, forces=False)[0]
        times += [processor_seconds(timed) for _ in range(repeats)]
        own += float(np.median(times))
        _, peaks = run_in_exudyn(machine, contest.cycles, setting, forces=True)
        assert peaks is not None
        judged.append(peaks[-contest.judged :])
        bar.update()
    cycles = contest.timed * len(judged)
    return judged, cycles / own, cycles / theirs


def _score(contest: Contest, judged: list[Array], right: list[int]) -> dict[str, Any]:
    """Compare what a simulator found at each speed with what is right."""
    found = [period_of(peaks, contest.repeatability) for peaks in judged]
    same_class = [(a > 0) == (b > 0) for a, b in zip(found, right, strict=True)]
    return {
        "right_class": sum(same_class),
        "right_period": sum(a == b for a, b in zip(found, right, strict=True)),
        "wrong_at": [speed for speed, same in zip(contest.speeds, same_class, strict=True) if not same],
        "mean_peak_force": [float(peaks.mean()) for peaks in judged],
    }
