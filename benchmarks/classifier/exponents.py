"""Largest Lyapunov exponents that libraries and the fitted map read out of short, noisy recordings.

The libraries are no dependency: ``pip install nolds neurokit2``. What can't be imported is named and left out.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.series.determinism import determinism

READINGS, RECORDS, NOISE = 500, 4, 0.05


def logistic(rng: np.random.Generator) -> Array:
    """Readings of x' = 4 x (1 - x), whose exponent is ln 2, with noise of 5 % of their deviation."""
    values = np.empty(READINGS)
    x = float(rng.uniform(0.2, 0.4))
    for k in range(READINGS):
        values[k] = x = 4.0 * x * (1.0 - x)
    noise: Array = NOISE * values.std() * rng.standard_normal(READINGS)
    return values + noise


def white(rng: np.random.Generator) -> Array:
    """Independent normal readings, which no map makes."""
    return rng.standard_normal(READINGS)


def _libraries() -> tuple[dict[str, Callable[[Array], float]], list[str]]:
    """What reads an exponent out of a recording, by name, and the libraries that can't be imported."""
    readers: dict[str, Callable[[Array], float]] = {"fitted map": lambda x: float(determinism(x).exponent[1])}
    absent = []
    try:
        import nolds

        readers["nolds lyap_r"] = lambda x: float(nolds.lyap_r(x, emb_dim=4, lag=1, min_tsep=5))
        readers["nolds lyap_e"] = lambda x: float(nolds.lyap_e(x, emb_dim=10, matrix_dim=4)[0])
    except Exception as error:  # nolds 0.6.3 raises FileNotFoundError under Python 3.11
        absent.append(f"nolds: {error!r}")
    try:
        import neurokit2

        readers["neurokit2"] = lambda x: float(neurokit2.complexity_lyapunov(x, delay=1, dimension=3)[0])
    except ImportError as error:
        absent.append(f"neurokit2: {error!r}")
    return readers, absent


def exponents(seed: int = 0) -> dict[str, Any]:
    """Smallest and largest exponent a cycle of four records each, by reader and kind of record."""
    rng = np.random.default_rng(seed)
    kinds = {"logistic map, ln 2 = 0.69": logistic, "white noise": white}
    records = {name: [draw(rng) for _ in range(RECORDS)] for name, draw in kinds.items()}
    readers, absent = _libraries()
    found: dict[str, Any] = {
        name: {kind: sorted(round(read(x), 3) for x in several)[:: RECORDS - 1] for kind, several in records.items()}
        for name, read in readers.items()
    }
    return {"exponents": found, "left_out": absent}
