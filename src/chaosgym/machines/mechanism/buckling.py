r"""Links that bend and that the forces of the nominal motion push beyond their Euler load.

A link pinned at both ends buckles under the load pi^2 E I / l^2 (Timoshenko and Gere, Theory of Elastic Stability,
2.1). Pushed with p times of it the geometric stiffness of its modes is -p times their own, in some shape: p is the
largest eigenvalue of that pair.
"""

import math
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.mechanism.beam import Beam
from chaosgym.machines.mechanism.links import Link


def buckling(link: Link, names: tuple[str, ...], stiffness: Array) -> tuple[str, ...]:
    """Tell of a link beyond its Euler load, in each plane in which it bends.

    Parameters
    ----------
    link
        Whose ``beam`` bends.
    names
        Of the machine's n coordinates.
    stiffness : (B, n, n)
        At equal steps of a revolution, with that of the forces of the nominal motion.

    Returns
    -------
    tuple of str
        Load, Euler load and crank angle; empty below the Euler load.
    """
    beam: Any = link.beam
    told = []
    for plane, moment in (("", beam.second_moment), ("sideways ", beam.sideways_moment)):
        modes = [name for name in link.elastic if name.startswith(f"{plane}mode ")]
        if not modes:
            continue
        at = [names.index(f"{link.name} {name}") for name in modes]
        own = link.stiffness.diagonal()[[link.elastic.index(name) for name in modes]]
        pushed = np.eye(len(at)) - stiffness[:, at][:, :, at] / np.sqrt(np.outer(own, own))
        shares = np.linalg.eigvalsh(pushed)[:, -1]
        worst = int(np.argmax(shares))
        if shares[worst] > 1.0:
            euler = _euler_load(beam, moment)
            told.append(
                f"{link.name} is pushed {plane}beyond its Euler load, where it buckles: {shares[worst] * euler:.4g} N "
                f"against {euler:.4g} N at crank angle {360.0 * worst / len(stiffness):.0f} deg"
            )
    return tuple(told)


def _euler_load(beam: Beam, second_moment: float) -> float:
    """Load [N] at which a beam that is pinned at both ends buckles."""
    return math.pi**2 * beam.youngs_modulus * second_moment / beam.length**2
