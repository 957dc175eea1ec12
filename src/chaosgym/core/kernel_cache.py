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
from functools import cache
from importlib.metadata import version
from pathlib import Path

CORE = Path(__file__).parent

NO_KERNELS = CORE / "compilation.py"
"""Decides when kernels are compiled, not what they are."""


def source_digest(*folders: Path) -> str:
    """Hash of all Python sources in some folders and below."""
    return _digest(path for folder in folders for path in sorted(folder.rglob("*.py")))


@cache
def kernel_digest(*folders: Path) -> str:
    """Hash of numba's version and of the sources of kernels: those of ``core``, and of some folders and below."""
    sources = (path for folder in (CORE, *folders) for path in sorted(folder.rglob("*.py")) if path != NO_KERNELS)
    return _digest(sources, version("numba"))


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

_kernels: dict[Path, tuple[Path, ...]] = {CORE: ()}
"""Folders of kernels, and the folders whose sources count beside those of ``core``."""


def cached_by_content(folder: Path) -> None:
    """Cache the kernels of a folder outside ``core`` by the content of its sources and of those of ``core``."""
    _kernels[folder] = (folder,)


def cache_folder(source: Path) -> str | None:
    """Where the kernels of a source are kept; None for those of others."""
    for folder, counted in _kernels.items():
        if source.is_relative_to(folder):
            return os.path.join(_ROOT, kernel_digest(*counted), source.parent.name)
    return None
