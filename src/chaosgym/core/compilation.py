"""Compilation of kernels that the package lacks: once on a computer, however many processes need them.

The first call of a kernel in a process loads its machine code from the disk, or compiles it, which takes seconds, and
keeps it there. A lock lets one process compile a kernel while others that need it wait and then load it; what is there
already is loaded without the lock. One line says what takes so long, and a bar how much is left.

What keeps it short: Python calls few kernels, with short chains of calls; arrays are copied in loops, since an
assignment compiles 60 functions; constants that are handed on are integers of numpy, since numba compiles anew for each
plain one.
"""

import atexit
import logging
import os
import shutil
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numba
from filelock import FileLock
from numba.core import event
from numba.core.dispatcher import Dispatcher
from tqdm import tqdm

from chaosgym.core.kernel_cache import KERNEL_CACHE, WANTED_CACHE, why_compile
from chaosgym.errors import ParameterError

logger = logging.getLogger("chaosgym")

PATIENCE = 2.0
"""Seconds after which a bar appears."""

_ready: set[tuple[Any, tuple[int, bool]]] = set()
"""Kernels with the number of their arguments, and whether the last is None: those that differ are compiled apart."""


def call(kernel: Any, *arguments: Any) -> Any:
    """Call a kernel; the first time, load it, or compile it while no other process compiles it.

    Raises
    ------
    ParameterError
        If NUMBA_DISABLE_JIT leaves kernels in Python, which has not all their operations.
    """
    _prepare_once(kernel, *arguments)
    return kernel(*arguments)


def _prepare_once(kernel: Any, *arguments: Any) -> None:
    key = (kernel, (len(arguments), arguments[-1] is None))
    if key not in _ready:
        prepare(kernel, *arguments)
        _ready.add(key)


def call_or_interpret(kernel: Any, *arguments: Any) -> Any:
    """Call a kernel that only computes, as plain Python does too: without the compiler as it is written."""
    return kernel(*arguments) if numba.config.DISABLE_JIT else call(kernel, *arguments)


THREADS = numba.config.NUMBA_NUM_THREADS
"""Threads that move the machines of a batch."""


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(THREADS, "chaosgym")


if hasattr(os, "register_at_fork"):
    # a child has none of its parent's threads
    os.register_at_fork(after_in_child=_threads.cache_clear)


def call_on_threads(kernel: Any, rows: int, *arguments: Any) -> None:
    """Call a kernel that goes through rows of arrays, from one to before another, on all threads: each has its rows."""
    threads = max(1, min(rows, THREADS))
    limits = [rows * k // threads for k in range(threads + 1)]
    (first, end), *others = pairwise(limits)
    _prepare_once(kernel, first, end, *arguments)
    moved = [_threads().submit(kernel, *span, *arguments) for span in others]
    kernel(first, end, *arguments)
    for one in moved:
        one.result()


def prepare(kernel: Any, *arguments: Any) -> None:
    """Compile or load a kernel for arguments of these types."""
    if numba.config.DISABLE_JIT:
        raise ParameterError("NUMBA_DISABLE_JIT is set, and kernels run as machine code only; unset it")
    types = [numba.typeof(argument) for argument in arguments]
    missing = kernel.py_func.__code__.co_argcount - len(types)
    defaults = (kernel.py_func.__defaults__ or ())[-missing:] if missing else ()
    signature = (*types, *(numba.types.Omitted(default) for default in defaults))
    if _loaded(kernel, signature):
        return
    with FileLock(_lock_file(kernel)):
        if _loaded(kernel, signature):
            return
        name, functions, why = name_of(kernel), _functions_of(kernel), _told_once()
        logger.log(logging.WARNING if why else logging.INFO, "compiling %s: %d functions%s", name, len(functions), why)
        with _shown(name, functions):
            kernel.compile(signature)


def _loaded(kernel: Any, signature: tuple[Any, ...]) -> bool:
    """Load machine code of a kernel; False where there is none for these arguments."""
    if not kernel._cache.has(signature, kernel.targetctx):
        return False
    kernel.compile(signature)
    return True


class _Count(event.Listener):  # type: ignore[misc] # numba has no types
    """Moves a bar on by each of some functions that is compiled."""

    def __init__(self, functions: set[Any], bar: Any) -> None:
        self._left, self._bar = set(functions), bar

    def on_start(self, event: event.Event) -> None:
        """Nothing to do."""

    def on_end(self, event: event.Event) -> None:
        """Count a function once: it may be compiled for several types, and others of numba's own are too."""
        function = event.data["dispatcher"]
        if function in self._left:
            self._left.remove(function)
            self._bar.update()


@contextmanager
def _shown(name: str, functions: set[Any]) -> Iterator[None]:
    """Bar of the functions that are compiled meanwhile, in a terminal, after two seconds."""
    with _bar(name, len(functions)) as bar, event.install_listener("numba:compile", _Count(functions, bar)):
        yield


def _bar(name: str, functions: int) -> Any:
    return tqdm(total=functions, desc=f"compiling {name}", unit="function", delay=PATIENCE, disable=None, leave=False)


def _functions_of(kernel: Any) -> set[Any]:
    """A kernel and all kernels that it may call, but for those that are written out in their callers.

    Friction is among them also where no joint rubs, and it is not compiled.
    """
    found, ahead = {kernel}, [kernel]
    while ahead:
        function = ahead.pop().py_func
        names = set(function.__code__.co_names) & set(function.__globals__)
        called = {one for one in map(function.__globals__.get, names) if isinstance(one, Dispatcher)} - found
        found |= called
        ahead += called
    return {one for one in found if one.targetoptions.get("inline") != "always"}


@cache
def _reason() -> str:
    if Path(KERNEL_CACHE).is_relative_to(WANTED_CACHE):
        return f", and others as they are called, for half a minute or more, once on this computer: {why_compile()}"
    return f", in every process, since {WANTED_CACHE} can't be written to; NUMBA_CACHE_DIR names another"


def _told_once() -> str:
    """Why kernels are compiled and how often, with the first of a process."""
    return "" if _reason.cache_info().currsize else _reason()


def name_of(kernel: Any) -> str:
    """Module and name of a kernel."""
    function = kernel.py_func
    return f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"


def _lock_file(kernel: Any) -> str:
    os.makedirs(KERNEL_CACHE, exist_ok=True)
    return os.path.join(KERNEL_CACHE, f"{name_of(kernel)}.lock")


def _remove_temporary_cache() -> None:
    root = Path(KERNEL_CACHE).parent
    if root.name.startswith("chaosgym-kernels-") and root.parent == Path(tempfile.gettempdir()):
        shutil.rmtree(root, ignore_errors=True)


atexit.register(_remove_temporary_cache)
