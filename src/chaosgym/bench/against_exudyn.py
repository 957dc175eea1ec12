"""How much faster is this package than Exudyn, and do both reach the same verdicts?

Cycles per second of processor time, on one thread, without recording; beside them how often the response is judged as
by exact events: periodic with the same period, or not. Both start from rest and are judged by the same rule.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.bench.exudyn_machines import ExudynSetting, load_exudyn, run_in_exudyn
from chaosgym.bench.timing import processor_seconds
from chaosgym.machines import THESIS_IMPACT_BEAM, THESIS_SLIDER_CRANK, Machine
from chaosgym.simulation import simulate

Array = NDArray[np.float64]

LONGEST_PERIOD = 8
"""Longest period, in cycles, that counts as periodic."""


@dataclass(frozen=True)
class Contest:
    """What is run in both simulators.

    Attributes
    ----------
    machine, speeds
        The machine, at each of some speeds in the unit of its speed field.
    settings
        Of Exudyn.
    cycles, judged, timed
        Cycles from rest of a run, how many at its end are judged, and how many of its first are timed.
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
    repeatability: float
    goal: float

    def machines(self) -> list[Machine]:
        """The machine at every speed."""
        kind: Any = self.machine
        return [replace(kind, **{self.machine.speed_field: speed}) for speed in self.speeds]


CONTESTS = (
    Contest(
        machine=replace(THESIS_IMPACT_BEAM, clearance=0.127e-3),
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
        repeatability=0.5,
        goal=80.0,
    ),
    Contest(
        machine=THESIS_SLIDER_CRANK,
        speeds=(100.0, 150.0, 200.0, 250.0),
        settings=(
            ExudynSetting("TrapezoidalIndex2", "stop", 1e-5, 1e-4),
            ExudynSetting("TrapezoidalIndex2", "stop", 2e-5, 1e-4),
        ),
        cycles=24,
        judged=16,
        timed=3,
        repeatability=0.5,
        goal=750.0,
    ),
)
"""The crank is dear in Exudyn, so it gets fewer speeds and cycles."""


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
        and its ``goal``; of how many ``speeds`` the verdict ``same_class`` and ``same_period``, and at which it
        ``differs_at``; mean peak forces of the judged cycles [N], ``mean_peak_force`` of both.

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
            own = [simulate(machine, contest.cycles).peak_force[-contest.judged :, 0] for machine in contest.machines()]
            speed = float(np.median([_own_rate(contest) for _ in range(repeats)]))
            rows += [_compared(contest, setting, own, speed, bar) for setting in contest.settings]
    return rows


def _own_rate(contest: Contest) -> float:
    """Cycles per second of processor time of this package, from rest, over all speeds."""
    machines = contest.machines()
    seconds = processor_seconds(lambda: [simulate(machine, contest.timed) for machine in machines])
    return contest.timed * len(machines) / seconds


def _compared(contest: Contest, setting: ExudynSetting, own: list[Array], speed: float, bar: Any) -> dict[str, Any]:
    seconds, theirs = 0.0, []
    for machine in contest.machines():
        seconds += run_in_exudyn(machine, contest.timed, setting, forces=False)[0]
        _, peaks = run_in_exudyn(machine, contest.cycles, setting, forces=True)
        assert peaks is not None
        theirs.append(peaks[-contest.judged :])
        bar.update()
    periods = [[period_of(peaks, contest.repeatability) for peaks in side] for side in (own, theirs)]
    same_class = [(a > 0) == (b > 0) for a, b in zip(*periods, strict=True)]
    exudyn_speed = contest.timed * len(theirs) / seconds
    return {
        "machine": contest.machine.name,
        "setting": str(setting),
        "cycles_per_processor_second": {"chaosgym": speed, "exudyn": exudyn_speed},
        "ratio": speed / exudyn_speed,
        "goal": contest.goal,
        "speeds": len(contest.speeds),
        "same_class": sum(same_class),
        "same_period": sum(a == b for a, b in zip(*periods, strict=True)),
        "differs_at": [speed for speed, same in zip(contest.speeds, same_class, strict=True) if not same],
        "mean_peak_force": {
            "chaosgym": [float(peaks.mean()) for peaks in own],
            "exudyn": [float(peaks.mean()) for peaks in theirs],
        },
    }
