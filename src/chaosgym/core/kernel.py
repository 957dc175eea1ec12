"""Decorators of kernels: those that only compute, pieces of others, and those that move many machines.

Kernels take ``njit`` from here, so that numba caches them where ``kernel_cache`` says.

Numba counts references to every array that a function is handed, two atomic operations each, which cost more than the
arithmetic of a short kernel. One that neither allocates nor returns an array needs no count: its caller keeps what it
works on alive.
"""

from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

from numba import njit
from numba.core import caching
from numba.core.registry import CPUDispatcher

from chaosgym.core.kernel_cache import cache_folder

__all__ = ["SideBySide", "entry", "leaf", "njit", "part", "side_by_side"]

# with an underscore in older versions of numba
_Locator: Any = getattr(caching, "UserProvidedCacheLocator", None) or caching._UserProvidedCacheLocator


class _ByContent(_Locator):  # type: ignore[misc] # numba has no types
    """Tells numba the folder of a kernel by ``kernel_cache``."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        self._cache_path = cache_folder(Path(py_file))

    def get_source_stamp(self) -> str:
        """The same stamp for every kernel: the folder is named by the hash of the sources."""
        return ""

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        """Locator of a kernel; None for functions of others."""
        return super(_Locator, cls).from_function(py_func, py_file) if cache_folder(Path(py_file)) else None


caching.CacheImpl._locator_classes = [_ByContent, *caching.CacheImpl._locator_classes]


_LEAF = {"cache": True, "nogil": True, "_nrt": False, "error_model": "numpy", "no_cfunc_wrapper": True}


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a ``leaf`` that Python calls."""
    compiled: Callable[..., Any] = njit(**_LEAF)(function)
    return compiled


def leaf(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel that allocates no array and returns none, without reference counts.

    Kernels alone call it: what takes arguments over from Python would be a tenth of all that is compiled.
    """
    compiled: Callable[..., Any] = njit(**_LEAF, no_cpython_wrapper=True)(function)
    if isinstance(compiled, CPUDispatcher):
        compiled.__class__ = _Inner
    return compiled


class _Inner(CPUDispatcher):  # type: ignore[misc] # numba has no types
    """A kernel that Python can't call: without this the process would crash."""

    def __call__(self, *arguments: Any) -> Any:
        """Refuse."""
        raise TypeError(f"{self.__name__} is called by kernels alone; declare it with entry, not with leaf")


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Always inline this kernel into its callers."""
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
