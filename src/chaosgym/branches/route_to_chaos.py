r"""Routes to chaos: by which bifurcation a periodic response gives way to a chaotic one between two points of a sweep.

    period doubling   the orbit flips, and its double flips in turn, towards the chaos
    intermittency     the orbit folds; beyond, the motion stays near the lost orbit again and again, the longer the
                      closer to the fold, with the distance to the power -1/2 (type I of Pomeau and Manneville)
    grazing           stability ends where a contact begins or ends at zero speed, and just beyond is chaos
    torus             stability ends in a Neimark-Sacker bifurcation, and just beyond is quasiperiodic motion
    crisis            none of these; the chaotic motion, carried towards the periodic point, ends and leaves its range
    not told          anything else; the reason says what was seen

References
----------
M. J. Feigenbaum, J. Stat. Phys. 19 (1978) 25-52. Y. Pomeau, P. Manneville, Commun. Math. Phys. 74 (1980) 189-197.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import groupby, pairwise
from typing import Literal, NamedTuple

import numpy as np
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import Bifurcation
from chaosgym.branches.bifurcation_diagram import BifurcationDiagram, Branch, SweepPoint
from chaosgym.branches.crisis import Crisis, boundary_crisis, carried, interior_crisis
from chaosgym.branches.diagram_search import PATIENCE, SAME_PLACE, follow
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.errors import DiagnosisError, SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate

Route = Literal["period doubling", "intermittency", "grazing", "torus", "crisis", "not told"]

SAME_PEAK = 0.02
"""Relative difference of peaks by which a point of a sweep lies on a branch, between two of its orbits."""

NEAR_FOLD, FARTHER = 0.02, 0.32
"""Shares of the way from a bifurcation to the chaotic point at which laminar phases, and natures, are looked at."""

LAMINAR = 0.1
"""Distance from the lost orbit, as a share of the largest that the motion has, within which a phase is laminar."""

FEWEST_PHASES, LONGER = 12, (2.0, 8.0)
"""Laminar phases that are needed, and how much longer they may be at a sixteenth of the distance: 4 by theory."""

DOUBLED, UNSTABLE = 24, 10.0
"""Longest period of a doubled branch between two points of a sweep, and its largest multiplier: stability counts."""

BUDGET = 3200
"""Cycles that tell the nature of the motion just beyond a bifurcation."""

PERIODS, SETTLED = 3000, 300
"""Periods of a motion that is searched for laminar phases, after those in which it settles."""


class Onset(NamedTuple):
    """Chaos that begins between two neighbouring points of a sweep.

    Attributes
    ----------
    periodic, chaotic
        Values of the field on either side.
    route
        See the module.
    because
        What tells so.
    """

    periodic: float
    chaotic: float
    route: Route
    because: str

    @property
    def line(self) -> str:
        """One line for people."""
        told = "route not told" if self.route == "not told" else self.route
        return f"chaos between {self.periodic:.6g} and {self.chaotic:.6g}: {told}; {self.because}"


def routes_to_chaos(diagram: BifurcationDiagram) -> tuple[Onset, ...]:
    """Name the route at each place of a diagram's sweep where a periodic point has a chaotic neighbour.

    Examples
    --------
    >>> import chaosgym
    >>> diagram = chaosgym.follow(chaosgym.ImpactBeam(), "speed", (17.0, 18.2))  # doctest: +SKIP
    >>> [one.route for one in routes_to_chaos(diagram)]  # doctest: +SKIP
    """
    found = []
    for pair in pairwise(diagram.sweep):
        for one, other in (pair, pair[::-1]):
            if one.period is not None and other.nature == "chaotic":
                found.append(Onset(one.value, other.value, *_told_or_crisis(diagram, one, other)))
    return tuple(found)


def routes_in_sweep(
    machine: Machine, field: str, values: Sequence[float], natures: Sequence[str], *, progress: bool = False
) -> tuple[tuple[Onset, ...], tuple[Crisis, ...]]:
    """Routes to chaos, and interior crises, between neighbouring points of a sweep along one field.

    Each pair of a periodic and a chaotic point is followed by branches of its own; between chaotic ones the motion is
    carried from one to the other, where its size changes.

    Parameters
    ----------
    machine, field
        What was swept.
    values, natures : (n,)
        Upwards, and what the machine does there from rest.
    progress
        Show a progress bar on standard error if it takes more than two seconds.
    """
    onsets: list[Onset] = []
    crises, run = [], carried(machine, field)
    pairs = list(pairwise(zip(values, natures, strict=True)))
    for (low, below), (high, above) in tqdm(pairs, desc="routes", unit="pair", delay=PATIENCE, disable=not progress):
        if {below, above} == {"periodic", "chaotic"}:
            diagram = follow(
                machine, field, (low, high), sweep=2, workers=1, longest_period=DOUBLED, most_unstable=UNSTABLE
            )
            onsets += routes_to_chaos(diagram)
        elif below == above == "chaotic":
            with suppress(SimulationError):
                crises.append(interior_crisis(run, low, high))
    return tuple(onsets), tuple(one for one in crises if one is not None)


def _told_or_crisis(diagram: BifurcationDiagram, periodic: SweepPoint, chaotic: SweepPoint) -> tuple[Route, str]:
    """Route between two points, and the reason; where the periodic motion tells none, that of the chaotic one."""
    route, because = _told(diagram, periodic, chaotic)
    if route == "not told":
        run = carried(diagram.machine, diagram.field)
        with suppress(SimulationError):
            crisis = boundary_crisis(run, chaotic.value, periodic.value)
            if crisis is not None:
                return "crisis", f"{because}; {crisis.because}"
    return route, because


def _told(diagram: BifurcationDiagram, periodic: SweepPoint, chaotic: SweepPoint) -> tuple[Route, str]:
    """Route between two points, and the reason."""
    span = sorted((periodic.value, chaotic.value))
    place = _on_a_branch(diagram, periodic)
    if place is None:
        return "not told", "no branch was followed through the periodic point"
    end = _end_of_stability(*place, periodic.value, float(np.sign(chaotic.value - periodic.value)))
    if end is not None and end.kind == "symmetry breaking" and span[0] <= end.value <= span[1]:
        broken = end
        end = _begun_at(diagram, broken, broken.period)
        if end is None:
            return "not told", f"the symmetry breaks at {broken.value:.6g}; where the new orbits end is not seen"
    if end is None:
        return "not told", "the periodic motion is not seen to lose its stability on the way"
    if not span[0] <= end.value <= span[1]:
        return "not told", f"the periodic motion stays stable up to {end.value:.6g}: the chaotic one lies beside it"
    if end.kind == "flip":
        return _doubled(diagram, end, span)
    if end.kind == "fold":
        machine = with_settings(diagram.machine, {diagram.field: end.value})
        lengths = laminar_phases(_section(machine, diagram.field, end.period), end.state, end.value, chaotic.value)
        return _intermittent(lengths, f"the orbit folds at {end.value:.6g}")
    beyond = _nature_beyond(diagram, end, chaotic.value)
    told = f"stability ends at {end.value:.6g} ({end.kind}); just beyond the motion is {beyond}"
    if end.kind == "grazing" and beyond == "chaotic":
        return "grazing", told
    if end.kind == "Neimark-Sacker" and beyond == "quasiperiodic":
        return "torus", told
    return "not told", told


def _nature_beyond(diagram: BifurcationDiagram, end: Bifurcation, chaotic: float) -> str:
    """Nature of the motion from the orbit at a bifurcation, a fiftieth of the way to a chaotic value beyond it."""
    value = end.value + NEAR_FOLD * (chaotic - end.value)
    try:
        machine = with_settings(diagram.machine, {diagram.field: value})
        return diagnose(machine, initial_state=end.state, budget=BUDGET).nature
    except (SimulationError, DiagnosisError):
        return "unknown"


def _on_a_branch(diagram: BifurcationDiagram, point: SweepPoint) -> tuple[Branch, int] | None:
    """The branch on which a stable periodic point lies, and the number of the orbit before it."""
    peak = float(point.peaks.max())
    for branch in diagram.branches:
        if branch.period != point.period:
            continue
        low, high = np.minimum(branch.values[:-1], branch.values[1:]), np.maximum(branch.values[:-1], branch.values[1:])
        for i in np.flatnonzero((low <= point.value) & (point.value <= high)):
            near = branch.peaks[i : i + 2].max(axis=1)
            if (
                branch.stable[i : i + 2].any()
                and near.min() - SAME_PEAK * peak <= peak <= near.max() + SAME_PEAK * peak
            ):
                return branch, int(i)
    return None


def _begun_at(diagram: BifurcationDiagram, at: Bifurcation, period: int) -> Bifurcation | None:
    """Where stability ends first on the branch that begins or ends at a bifurcation, if its orbits there are stable."""
    begun = f"{at.kind} at {diagram.field} = {at.value:.8g}"
    for branch in (one for one in diagram.branches if one.period == period):
        if branch.begins == begun and branch.stable[0]:
            return _first(branch.bifurcations)
        for second, order in ((1, branch.bifurcations), (-2, branch.bifurcations[::-1])):
            ends = bool(order) and order[0].ends and order[0].kind == at.kind and bool(branch.stable[second])
            if ends and abs(order[0].value - at.value) < SAME_PLACE * abs(at.value):
                return _first(order)
    return None


def _end_of_stability(branch: Branch, orbit: int, point: float, side: float) -> Bifurcation | None:
    """First bifurcation at which stability ends, from a point after an orbit towards larger or smaller values."""
    ahead = side * (branch.values[min(orbit + 1, len(branch) - 1)] - branch.values[orbit]) > 0.0
    places = list(zip(branch.at, branch.bifurcations, strict=True))
    here = [one for at, one in places if at == orbit and side * (one.value - point) > 0.0]
    if ahead:
        return _first([*here, *(one for at, one in places if at > orbit)])
    return _first([*here[::-1], *(one for at, one in places[::-1] if at < orbit)])


def _first(bifurcations: Sequence[Bifurcation]) -> Bifurcation | None:
    """First at which stability ends and the branch goes on."""
    return next((one for one in bifurcations if one.loses_stability and not one.ends), None)


def _doubled(diagram: BifurcationDiagram, first: Bifurcation, span: list[float]) -> tuple[Route, str]:
    """Whether doubled orbits flip in turn, the one after the other, on the way to the chaos."""
    flips = [first]
    while True:
        after = _begun_at(diagram, flips[-1], 2 * flips[-1].period)
        if after is None or after.kind != "flip" or not span[0] <= after.value <= span[1]:
            break
        flips.append(after)
    told = "flips at " + ", ".join(f"{one.value:.6g} (period {one.period})" for one in flips)
    if len(flips) == 1:
        return "not told", f"{told}, and the doubled orbit is not seen to flip"
    if len(flips) > 2:
        ratios = feigenbaum_ratios([one.value for one in flips])
        told += "; distances shrink by " + ", ".join(f"{ratio:.3g}" for ratio in ratios)
    return "period doubling", told


def feigenbaum_ratios(values: list[float]) -> list[float]:
    """Ratios of the distances between successive flips; they tend to 4.669 (Feigenbaum 1978)."""
    return [(b - a) / (c - b) for a, b, c in zip(values, values[1:], values[2:], strict=False)]


def _section(machine: Machine, field: str, period: int) -> Callable[[float, Array | None, int], Array]:
    """What gives the states (steps, n), in coordinates of energy, one a period, of the motion at a value."""

    def run(value: float, state: Array | None, steps: int) -> Array:
        other = with_settings(machine, {field: value})
        record = simulate(other, steps * period, state)
        return np.asarray(record.section[::period] * machine.state_weights(record.section[0]))

    return run


def laminar_phases(
    states: Callable[[float, Array | None, int], Array], orbit: Array, fold: float, chaotic: float
) -> tuple[list[int], list[int]]:
    """Lengths, in steps, of the phases in which a motion stays near an orbit that vanished in a fold.

    Parameters
    ----------
    states
        Gives the states (steps, n) of the motion at a value from a state, or from rest, so many steps on.
    orbit : (n,)
        State of the orbit at the fold.
    fold, chaotic
        Value of the fold, and one beyond it where the motion is chaotic.

    Returns
    -------
    (near, far) : those at a fiftieth of the way from the fold, and those at 16 times that distance.
    """
    found: list[list[int]] = []
    for share in (NEAR_FOLD, FARTHER):
        value = fold + share * (chaotic - fold)
        try:
            path = states(value, orbit, SETTLED + PERIODS)[SETTLED:]
        except SimulationError:
            found.append([])
            continue
        start = states(fold, orbit, 1)[0]
        distance = np.linalg.norm(path - start, axis=1)
        laminar = distance < LAMINAR * distance.max()
        lengths = [len(list(phase)) for near, phase in groupby(laminar) if near]
        found.append(lengths[1:-1])
    return found[0], found[1]


def _intermittent(lengths: tuple[list[int], list[int]], told: str) -> tuple[Route, str]:
    """What the laminar phases beyond a fold tell."""
    near, far = lengths
    if min(len(near), len(far)) < FEWEST_PHASES:
        return "not told", f"{told}; beyond, the motion does not come back near it often enough"
    ratio = float(np.mean(near) / np.mean(far))
    told += f"; {np.mean(far):.3g} periods near it at a time, {np.mean(near):.3g} at a 16th of the distance"
    return ("intermittency", told) if LONGER[0] < ratio < LONGER[1] else ("not told", told)
