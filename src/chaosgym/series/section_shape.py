"""The shape of a stroboscopic section: a closed curve, or a set with more structure (step II, thesis 5.2.1).

A closed orbit of the section is quasiperiodic, a fractal one chaotic. Joined each to its nearest by a minimal spanning
tree, points of a closed curve lie on one path without branches whose ends meet. A folded set has branches, and an arc
has ends that lie far apart.

References
----------
V. Robins, J. D. Meiss, E. Bradley, Computing connectedness: disconnectedness and discreteness, Physica D 139 (2000).
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Shape = Literal["closed curve", "set with structure", "too few points"]

FEWEST_POINTS, MOST_POINTS = 64, 128
"""Points of one band below which nothing is told, and beyond which more would tell nothing new."""

ON_PATH = 0.95
"""Share of the points that the longest path of the tree holds if there are no branches."""

MEETING, LONGEST_STEP = 3.0, 0.25
"""How many of the longest steps along the path its ends may lie apart and still meet, and how long a step may be as a
share of the set: a longer one joins parts."""

DELAYS = 3
"""Coordinates in which a single series shows a closed curve without crossings (Takens: twice its dimension, plus 1)."""


def section_shape(points: ArrayLike, bands: int = 1) -> Shape:
    """Tell whether a stroboscopic section is a closed curve.

    Parameters
    ----------
    points : (cycles,) or (cycles, coordinates)
        One sample of a settled motion a cycle, without noise. A single coordinate is seen in three delays.
    bands
        Number of parts that the motion visits in turn; one of them is looked at.

    Returns
    -------
    str
        "closed curve"; "set with structure", which is anything else; or "too few points", fewer than 64 in a band.

    Examples
    --------
    >>> import numpy as np
    >>> from chaosgym.series import section_shape
    >>> section_shape(np.cos(np.arange(400.0)))
    'closed curve'
    """
    from scipy.sparse.csgraph import minimum_spanning_tree

    samples = np.asarray(points, dtype=float)
    samples = samples[:, None] if samples.ndim == 1 else samples
    if samples.shape[1] == 1:
        count = len(samples) - bands * (DELAYS - 1)
        samples = np.column_stack([samples[k * bands : k * bands + max(count, 0), 0] for k in range(DELAYS)])
    kept = samples[::-bands][:MOST_POINTS]
    spread = np.std(kept, axis=0) if len(kept) else np.zeros(samples.shape[1])
    moving = spread > 1e-9 * np.max(np.abs(samples), axis=0, initial=0.0)
    if len(kept) < FEWEST_POINTS or not moving.any():
        return "too few points"
    apart = np.sqrt(sum((x[:, None] - x) ** 2 for x in (kept[:, moving] / spread[moving]).T))
    apart[apart == 0.0] = 1e-12  # the graph takes 0 for no edge
    np.fill_diagonal(apart, 0.0)
    tree = minimum_spanning_tree(apart)
    path, longest = _longest_path(tree + tree.T)
    meets = apart[path[0], path[-1]] <= MEETING * longest and longest <= LONGEST_STEP * float(apart.max())
    return "closed curve" if len(path) >= ON_PATH * len(kept) and meets else "set with structure"


def _longest_path(tree: object) -> tuple[list[int], float]:
    """Points of the path between the two ends that are farthest apart along the tree, and its longest step."""
    from scipy.sparse.csgraph import depth_first_order, dijkstra

    start = int(np.argmax(dijkstra(tree, indices=0)))
    along = dijkstra(tree, indices=start)
    _, before = depth_first_order(tree, start, directed=False)
    path = [int(np.argmax(along))]
    while path[-1] != start:
        path.append(int(before[path[-1]]))
    return path, float(np.max(np.abs(np.diff(along[path]))))
