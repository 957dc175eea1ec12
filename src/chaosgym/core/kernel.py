"""Decorators of kernels: those that only compute, pieces of others, and those that move many machines.

Kernels take ``njit`` from here, so that their machine code is kept where ``kernel_cache`` says.

Numba counts references to every array that a function is handed, two atomic operations each, which cost more than the
arithmetic of a short kernel. One that neither allocates nor returns an array needs no count: its caller keeps what it
works on alive.
"""

from collections.abc import Callable
from types import FunctionType
from typing import Any, NamedTuple

import numba
from numba.core.dispatcher import Dispatcher

from chaosgym.core.machine_code import KernelCache

__all__ = ["SideBySide", "leaf", "njit", "part", "side_by_side"]


def njit(*, cache: bool = True, **options: Any) -> Callable[[Any], Any]:
    """As numba's, with a cache of its own: with ``NUMBA_DISABLE_JIT`` the function itself."""

    def decorate(function: Any) -> Any:
        compiled: Any = numba.njit(**options)(function)
        if cache and isinstance(compiled, Dispatcher):
            compiled._cache = KernelCache(function)  # type: ignore[attr-defined]
        return compiled

    return decorate


def leaf(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that allocates no array and returns none, without reference counts."""
    compiled: Callable[..., Any] = njit(nogil=True, _nrt=False, error_model="numpy", no_cfunc_wrapper=True)(function)
    return compiled


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Always inline this kernel into its callers."""
    compiled: Callable[..., Any] = njit(inline="always")(function)
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
    return SideBySide(njit(nogil=True, parallel=True)(function), njit(nogil=True)(alone))
