r"""Links that bend and that the forces of the nominal motion push beyond their Euler load.

A link pinned at both ends buckles under the load pi^2 E I / l^2 (Timoshenko and Gere, Theory of Elastic Stability,
2.1). Pushed with p times of it the geometric stiffness of its modes is -p times their own, in some shape: p is the
largest eigenvalue of that pair.
"""

import math

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.mechanism.equations import assembled
from chaosgym.machines.mechanism.links import Beam, Link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.nominal import Revolution

ANGLES = 72
"""Crank angles at which links are asked whether they buckle."""


def buckling(mechanism: Mechanism, revolution: Revolution, rate: float) -> tuple[str, ...]:
    """Tell of each link beyond its Euler load, in each plane in which it bends, at a rate [rad/s] of the crank.

    Returns
    -------
    tuple of str
        Load, Euler load and crank angle of each; empty if there is none.
    """
    bent = [(link, link.beam) for link in mechanism.links if link.beam is not None]
    if not bent:
        return ()
    theta = np.linspace(0.0, 2.0 * math.pi, ANGLES, endpoint=False)
    with_forces, without = (
        assembled(mechanism, revolution, geometric=geometric).matrices_at(theta)[2] for geometric in (True, False)
    )
    stiffening = np.tensordot(rate ** np.arange(3), with_forces - without, 1)
    told = []
    for link, beam in bent:
        for plane, moment in (("", beam.second_moment), ("sideways ", beam.sideways_moment)):
            shares = _shares(mechanism, link, f"{plane}mode ", stiffening)
            worst = int(np.argmax(shares))
            if shares[worst] > 1.0:
                euler = _euler_load(beam, moment)
                told.append(
                    f"{link.name} is pushed {plane}beyond its Euler load, where it buckles: "
                    f"{shares[worst] * euler:.4g} N against {euler:.4g} N at crank angle "
                    f"{360.0 * worst / ANGLES:.0f} deg"
                )
    return tuple(told)


def _shares(mechanism: Mechanism, link: Link, modes: str, stiffening: Array) -> Array:
    """Load at each angle (B,) in Euler loads, of the geometric stiffness (B, n, n), in a plane whose modes begin so."""
    names = [name for name in link.elastic if name.startswith(modes)]
    if not names:
        return np.zeros(len(stiffening))
    at = [mechanism.coordinates.index(f"{link.name} {name}") for name in names]
    own = np.sqrt(link.stiffness.diagonal()[[link.elastic.index(name) for name in names]])
    return np.asarray(np.linalg.eigvalsh(-stiffening[:, at][:, :, at] / np.outer(own, own))[:, -1])


def _euler_load(beam: Beam, second_moment: float) -> float:
    """Load [N] at which a beam that is pinned at both ends buckles."""
    return math.pi**2 * beam.youngs_modulus * second_moment / beam.length**2
