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
    compiled: Callable[..., Any] = njit(cache=True, nogil=True, _nrt=False)(function)
    return compiled


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """As ``leaf``, for parts of a kernel that are handed many arrays: they become part of their caller.

    A call would copy every array's pointer, shape and strides to the stack, which takes longer than the part.
    """
    compiled: Callable[..., Any] = njit(cache=True, nogil=True, _nrt=False, forceinline=True, error_model="numpy")(
        function
    )
    return compiled
