"""Decorators of kernels: those that only compute, and pieces of others.

Kernels take ``njit`` from here, so that their machine code is kept where ``kernel_cache`` says.

Numba counts references to every array that a function is handed, two atomic operations each, which cost more than the
arithmetic of a short kernel. One that neither allocates nor returns an array needs no count: its caller keeps what it
works on alive.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba.core.dispatcher import Dispatcher

from chaosgym.core.machine_code import KernelCache

__all__ = ["leaf", "njit", "part"]


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
