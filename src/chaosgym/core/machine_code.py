"""Machine code of kernels on the disk: numba's cache, in our folders and with checksums.

Numba asks a kernel's dispatcher for its cache, which is ours for these kernels and numba's own for all others. The key
of shipped machine code names its processor, whatever numba compiles for in this process. What is damaged counts as
missing and is made anew.
"""

import hashlib
import logging
import os
import pickle
import platform
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from filelock import FileLock
from llvmlite.binding import get_host_cpu_features
from numba.core import caching
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from chaosgym.core.kernel_cache import BASELINE, ROOT, SHIPPED, place_of

logger = logging.getLogger("chaosgym")

NEEDED = ("avx2", "fma", "bmi2")
"""What an x86 processor must have to run shipped machine code."""


@cache
def runs_baseline() -> bool:
    """Whether shipped machine code is wanted, and runs on this processor."""
    if os.environ.get("CHAOSGYM_KERNELS") == "none":
        return False
    if platform.machine() not in ("x86_64", "AMD64"):
        return platform.machine() in BASELINE
    features = get_host_cpu_features()
    return all(features.get(name) for name in NEEDED)


class _Locator(caching._CacheLocator):  # type: ignore[misc] # numba has no types
    """Tells numba the folder of a kernel, and the same stamp for every one: the folder's name has the digest."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_file, self._lineno = py_file, py_func.__code__.co_firstlineno
        self._folder = os.path.join(ROOT, place_of(Path(py_file)))

    def get_cache_path(self) -> str:
        return self._folder

    def get_source_stamp(self) -> str:
        return ""

    def get_disambiguator(self) -> str:
        return str(self._lineno)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        return cls(py_func, py_file)


class _MachineCode(caching.CompileResultCacheImpl):  # type: ignore[misc] # numba has no types
    """Machine code of a kernel as it lies on the disk, with its checksum."""

    _locator_classes = (_Locator,)

    def reduce(self, cres: Any) -> tuple[bytes, bytes]:
        content = dumps(super().reduce(cres))
        return hashlib.sha256(content).digest(), content

    def rebuild(self, target_context: Any, payload: tuple[bytes, bytes]) -> Any:
        checksum, content = payload
        if hashlib.sha256(content).digest() != checksum:
            raise ValueError("its checksum differs")
        return super().rebuild(target_context, pickle.loads(content))


class KernelCache(caching.FunctionCache):  # type: ignore[misc] # numba has no types
    """Machine code of a kernel: what is shipped, then what was compiled here."""

    _impl_class = _MachineCode

    def __init__(self, py_func: Any) -> None:
        super().__init__(py_func)
        folder = os.path.join(SHIPPED, os.path.relpath(self._cache_path, ROOT))
        self._shipped = caching.IndexDataCacheFile(folder, self._impl.filename_base, "")

    def _places(self, signature: tuple[Any, ...], codegen: Any) -> Iterator[tuple[Any, tuple[Any, ...]]]:
        """Files in which a kernel may lie, and its key in each."""
        types, own, code = self._index_key(signature, codegen)
        if runs_baseline():
            yield self._shipped, (types, (own[0], BASELINE[platform.machine()], ""), code)
        yield self._cache_file, (types, own, code)

    def has(self, signature: tuple[Any, ...], target_context: Any) -> bool:
        """Whether a kernel lies on the disk for some types; a damaged file has none."""
        places = self._places(signature, target_context.codegen())
        return any(key in self._index(file) for file, key in places)

    def _index(self, file: Any) -> dict[Any, str]:
        try:
            index: dict[Any, str] = file._load_index()
        except Exception as error:  # whatever reading a damaged pickle raises
            self._give_up(file, error)
            return {}
        return index

    def save_overload(self, sig: tuple[Any, ...], data: Any) -> None:
        """Save a kernel while no other process does: numba reads an index of files, adds a name to it and writes it."""
        os.makedirs(self._cache_path, exist_ok=True)
        with FileLock(os.path.join(self._cache_path, "saving.lock")):
            super().save_overload(sig, data)

    def load_overload(self, sig: tuple[Any, ...], target_context: Any) -> Any:
        """Load a kernel, without what numba imports to compile: machine code needs counts of references alone."""
        rtsys.initialize(target_context)
        for file, key in self._places(sig, target_context.codegen()):
            try:
                data = file.load(key)
                if data is not None:
                    return self._impl.rebuild(target_context, data)
            except Exception as error:  # whatever reading a damaged pickle raises
                self._give_up(file, error)
        return None

    def _give_up(self, file: Any, error: Exception) -> None:
        logger.warning("machine code of %s is damaged (%s) and made anew", self._py_func.__qualname__, error)
        if file is self._cache_file:
            file.flush()
