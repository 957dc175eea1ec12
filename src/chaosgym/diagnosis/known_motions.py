"""On which of the motions met so far a path lies: near an orbit and nearing it, or among the states of a set."""

import math
from dataclasses import replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.attractor import Attractor
from chaosgym.machines.ignorable import relative
from chaosgym.simulation import CycleRecord

ARRIVED, APART = 1e-2, 0.1
"""Distance from an orbit at which a start has arrived, relative to the larger of orbit and box, and the largest ratio
of it to the distance from any other orbit."""

APPROACHES, CLOSELY = 3, 1e-6
"""Periods over which the distance of a start that has arrived must have fallen, and the one at which it need not."""

SAME = 1e-3
"""Distance of two orbits that are one, and miss of a motion that repeats."""

WITHIN = 3.0
"""Ratio of the distances between neighbouring states, from a start to a set and within the set, up to which the start
moves on the set."""

TAIL, LEAST_SET = 64, 100
"""Fewest states of a start that are compared with a set, and of a set."""


class KnownMotions:
    """The motions met so far.

    Parameters
    ----------
    scale : (n_states,)
        Of the box of starts; states in which it is 0 do not count.
    """

    def __init__(self, scale: Array) -> None:
        with np.errstate(divide="ignore"):
            weight = np.where(scale > 0.0, 1.0 / scale, 0.0)
        self.weight = weight / math.sqrt(int(np.count_nonzero(weight)) or 1)
        self.motions: list[Attractor] = []

    def _distances(self, states: Array) -> Array:
        """Smallest distance of each state (k, n) from each of the motions: (motions, k)."""
        return np.array(
            [
                np.min(np.linalg.norm(self.weight * (states[:, None] - one.states), axis=2), axis=1)
                for one in self.motions
            ]
        )

    def _size(self, motion: Attractor) -> float:
        return max(1.0, float(np.max(np.linalg.norm(self.weight * motion.states, axis=1))))

    def arrived(self, path: Array) -> int | None:
        """Number of the repeating motion on which a path (k, n_states) ends, or None."""
        orbits = [place for place, one in enumerate(self.motions) if one.period]
        if not orbits:
            return None
        now = self._distances(path[-1:])[:, 0]
        nearest = min(orbits, key=lambda place: now[place])
        one = self.motions[nearest]
        beside = min((now[place] for place in orbits if place != nearest), default=np.inf)
        near = now[nearest] < ARRIVED * self._size(one) and now[nearest] <= APART * beside
        return nearest if near and self._nears(path, one) else None

    def on_a_set(self, record: CycleRecord) -> int | None:
        """Number of the set of states on which a run ends, or None."""
        path = path_of(record, max(TAIL, len(record) // 2))
        free = len(record) >= TAIL and not record.peak_force.any()
        for place, one in enumerate(self.motions):
            if one.period is None and (free if one.neutral else self._on_set(path, one)):
                return place
        return None

    def _nears(self, path: Array, motion: Attractor) -> bool:
        """Whether a path came nearer to an orbit from period to period at the end, or is on it.

        A torus beside an orbit of a long period is near it too: it takes all periods to tell.
        """
        back = path[:: -(motion.period or 1)][: APPROACHES + 1]
        distance = np.min(np.linalg.norm(self.weight * (back[:, None] - motion.states), axis=2), axis=1)
        nearing = len(distance) > APPROACHES and np.all(distance[:-1] <= distance[1:])
        return bool(distance[0] < CLOSELY or nearing)

    def _on_set(self, path: Array, motion: Attractor) -> bool:
        """Whether a path moves on a set."""
        if len(motion.states) < LEAST_SET or len(path) < TAIL:
            return False
        from scipy.spatial import cKDTree  # slow to import, and few searches need it

        tree = cKDTree(self.weight * motion.states)
        within = float(np.median(tree.query(self.weight * motion.states, k=2)[0][:, 1]))
        return float(np.median(tree.query(self.weight * path)[0])) <= WITHIN * within

    def add(self, motion: Attractor | None) -> int | None:
        """Number of a motion, which is added unless it is known."""
        if motion is None:
            return None
        for place, one in enumerate(self.motions):
            if (one.period, one.neutral) != (motion.period, motion.neutral):
                continue
            if one.neutral:
                self.motions[place] = replace(one, peaks=np.maximum(one.peaks, motion.peaks))
                return place
            if one.period is None and self._on_set(motion.states, one):
                return place
            near = one.period and self._distances(motion.state[None])[place, 0] < SAME * self._size(one)
            alike = np.allclose(one.peaks, motion.peaks, rtol=SAME, atol=SAME * one.largest_peak)
            if near or (one.period and one.orbit is None and alike):
                return place
        self.motions.append(motion)
        return len(self.motions) - 1


def path_of(record: CycleRecord, cycles: int = TAIL) -> Array:
    """The last states of a run, (k, n_states), less what no force depends on."""
    return relative(record.machine, np.vstack([record.section[-cycles:], record.final_state.coordinates]))
