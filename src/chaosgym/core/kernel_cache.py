"""Where compiled kernels are kept: in folders named by the content of their sources, wherever these are installed.

Numba looks at the file of the function that is called alone, and would keep serving old machine code after an edit in
a helper. It names its folders by the path of the sources, so that each environment compiles for itself. Here the name
of a folder is a digest of all sources of its kernels and of numba's version; in it, numba tells versions of Python and
processors apart.
"""

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba
from numba.core import caching

CORE = Path(__file__).parent

NO_KERNELS = CORE / "compilation.py"
"""Decides when kernels are compiled, not what they are."""


def source_digest(*folders: Path) -> str:
    """Hash of all Python sources in some folders and below."""
    return _digest(path for folder in folders for path in sorted(folder.rglob("*.py")))


def kernel_digest(*folders: Path) -> str:
    """Hash of numba's version and of the sources of kernels: those of ``core``, and of some folders and below."""
    sources = (path for folder in (CORE, *folders) for path in sorted(folder.rglob("*.py")) if path != NO_KERNELS)
    return _digest(sources, numba.__version__)


def _digest(sources: Iterator[Path], *words: str) -> str:
    content = b"".join([*(path.read_bytes() for path in sources), *(word.encode() for word in words)])
    return hashlib.sha256(content).hexdigest()[:16]


def _is_writable(folder: str) -> bool:
    try:
        os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"x")
    except OSError:
        return False
    return True


WANTED_CACHE = os.environ.get("NUMBA_CACHE_DIR") or os.path.join(
    os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "chaosgym", "kernels"
)
"""Where compiled kernels are kept if that folder can be written to."""

_ROOT = WANTED_CACHE if _is_writable(WANTED_CACHE) else tempfile.mkdtemp(prefix="chaosgym-kernels-")

KERNEL_CACHE = os.path.join(_ROOT, kernel_digest())
"""Folder of the compiled kernels: in a new temporary folder where the wanted one is read-only or the disk is full."""

_folders: list[str] = []
"""Those of the kernels that are being imported, the innermost last."""

# with an underscore in older versions of numba
_Locator: Any = getattr(caching, "UserProvidedCacheLocator", None) or caching._UserProvidedCacheLocator


class _ByContent(_Locator):  # type: ignore[misc] # numba has no types
    """Tells numba the folder of a kernel that is imported by ``cached_by_content``."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        self._cache_path = os.path.join(_folders[-1], Path(py_file).parent.name)

    def get_source_stamp(self) -> str:
        """Of every kernel the same: the folder's name tells the sources."""
        return ""

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        """Locator of a kernel; None for functions of others."""
        return super(_Locator, cls).from_function(py_func, py_file) if _folders else None


caching.CacheImpl._locator_classes = [_ByContent, *caching.CacheImpl._locator_classes]


@contextmanager
def cached_by_content(*folders: Path) -> Iterator[None]:
    """Kernels imported meanwhile, those of ``core`` or of some folders, are cached by the content of these.

    Kernels outside ``core`` call those inside, so that the sources of both count.
    """
    _folders.append(os.path.join(_ROOT, kernel_digest(*folders)))
    try:
        yield
    finally:
        _folders.pop()
