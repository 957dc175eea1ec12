r"""The basic rating life: damage of a bearing surface by a cycle of given peak force.

    L = (C / F)^p                          life in millions of cycles under a constant peak force F (thesis eq. 5.2)
    1 / L = (F / C)^p                      damage: lives used up in a million cycles

References
----------
ISO 281:2007, Rolling bearings - Dynamic load ratings and rating life.
"""

import numpy as np

from chaosgym.arrays import Array

LIFE_EXPONENT = 10.0 / 3.0
"""Exponent p of eq. 5.2, line contact."""


def damage_in_a_million(force: Array, load_rating: float, exponent: float = LIFE_EXPONENT) -> Array:
    """Lives that a million cycles with each of the peak forces [N] use up.

    ``load_rating`` C [N] is the force under which a surface lasts a million cycles.
    """
    return np.asarray((force / load_rating) ** exponent)
