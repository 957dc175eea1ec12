"""Decorators of kernels: those that only compute, pieces of others, and those that move many machines.

Numba counts references to every array that a function is handed, two atomic operations each, which cost more than the
arithmetic of a short kernel. One that neither allocates nor returns an array needs no count: its caller keeps what it
works on alive.
"""

from collections.abc import Callable
from types import FunctionType
from typing import Any, NamedTuple

from numba import njit


def leaf(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that allocates no array and returns none, without reference counts."""
    compiled: Callable[..., Any] = njit(cache=True, nogil=True, _nrt=False, error_model="numpy")(function)
    return compiled


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a piece of other kernels as if it were written out in each: it needs no call and no code of its own."""
    compiled: Callable[..., Any] = njit(cache=True, inline="always")(function)
    return compiled


class SideBySide(NamedTuple):
    """A kernel over machines, twice: on all threads, and on one."""

    parallel: Callable[..., Any]
    serial: Callable[..., Any]


def side_by_side(function: Any) -> SideBySide:
    """Compile a kernel whose ``prange`` goes over machines for all threads, and for one.

    A process that has used GNU OpenMP, as all threads do, can't be forked by one that uses it too.
    """
    # numba names its cache of a function by the qualified name
    alone = FunctionType(function.__code__, function.__globals__, f"{function.__name__}_serially")
    alone.__qualname__ = alone.__name__
    return SideBySide(njit(cache=True, nogil=True, parallel=True)(function), njit(cache=True, nogil=True)(alone))
