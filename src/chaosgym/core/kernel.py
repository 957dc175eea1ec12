"""Decorator of kernels that only compute.

Numba counts references to every array that a function is handed, two atomic operations each, which cost more than the
arithmetic of a short kernel. One that neither allocates nor returns an array needs no count: its caller keeps what it
works on alive.
"""

from collections.abc import Callable
from typing import Any

from numba import njit


def leaf(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that allocates no array and returns none, without reference counts."""
    compiled: Callable[..., Any] = njit(cache=True, nogil=True, _nrt=False, error_model="numpy")(function)
    return compiled


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a piece of other kernels as if it were written out in each: it needs no call and no code of its own."""
    compiled: Callable[..., Any] = njit(cache=True, inline="always")(function)
    return compiled
