"""Where compiled kernels are kept: with the package, and in a folder of the user's for what that lacks.

Numba looks at the file of the function that is called alone, and would keep serving old machine code after an edit in
a helper. It names its folders by the path of the sources, so that each environment compiles for itself. Here the name
of a folder is a digest of all sources of its kernels and of numba's version; in it, numba tells versions of Python and
processors apart.

The package ships machine code of one processor (``BASELINE``), whose bits and speed are those of newer ones: AVX-512
brings these kernels nothing. What is compiled later is for the processor at hand.
"""

import hashlib
import os
import platform
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path

CORE = Path(__file__).parent

NO_KERNELS = tuple(CORE / f"{name}.py" for name in ("compilation", "kernel_cache", "machine_code", "matrices"))
"""These decide where and when kernels are compiled and how they are called, not what they are."""

SHIPPED = CORE.parent / "compiled"
"""Folder of the machine code that comes with the package."""

MADE_FOR = SHIPPED / "made-for.txt"
"""What it is for, as ``environment`` tells it."""

BASELINE = {"x86_64": "x86-64-v3", "AMD64": "x86-64-v3", "aarch64": "generic", "arm64": "apple-m1"}
"""Processor of shipped machine code, by the kind of machine: with AVX2 and fused multiply-add, as since 2013."""


def source_digest(*folders: Path) -> str:
    """Hash of all Python sources in some folders and below."""
    return _digest(path for folder in folders for path in sorted(folder.rglob("*.py")))


@cache
def kernel_digest(*folders: Path) -> str:
    """Hash of numba's version and of the sources of kernels: those of ``core``, and of some folders and below."""
    sources = (path for folder in (CORE, *folders) for path in sorted(folder.rglob("*.py")) if path not in NO_KERNELS)
    return _digest(sources, version("numba"))


def _digest(sources: Iterator[Path], *words: str) -> str:
    content = b"".join([*(path.read_bytes() for path in sources), *(word.encode() for word in words)])
    return hashlib.sha256(content).hexdigest()[:16]


def environment() -> str:
    """What machine code depends on beside the kernels, in words."""
    processor = BASELINE.get(platform.machine(), platform.machine())
    return f"numba {version('numba')}, Python {sys.version_info.major}.{sys.version_info.minor}, {processor}"


def why_compile() -> str:
    """Why a kernel is not with the package, in words."""
    if os.environ.get("CHAOSGYM_KERNELS") == "none":
        return "CHAOSGYM_KERNELS is none"
    made_for = MADE_FOR.read_text() if MADE_FOR.exists() else ""
    if not made_for:
        return "the package has no machine code"
    if made_for != environment():
        return f"the package has machine code for {made_for}"
    if not (SHIPPED / kernel_digest()).exists():
        return "the package's machine code is of other sources; `python -m chaosgym.kernels` compiles all of it"
    return "the package has no machine code of it for this processor"


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

ROOT = WANTED_CACHE if _is_writable(WANTED_CACHE) else tempfile.mkdtemp(prefix="chaosgym-kernels-")

KERNEL_CACHE = os.path.join(ROOT, kernel_digest())
"""Folder of the compiled kernels: in a new temporary folder where the wanted one is read-only or the disk is full."""

_kernels: dict[Path, tuple[Path, ...]] = {CORE: ()}
"""Folders of kernels, and the folders whose sources count beside those of ``core``."""


def cached_by_content(folder: Path) -> None:
    """Cache the kernels of a folder outside ``core`` by the content of its sources and of those of ``core``."""
    _kernels[folder] = (folder,)


def place_of(source: Path) -> str:
    """Folder of the kernels of a source, below the shipped folder and the user's."""
    counted = next(counted for folder, counted in _kernels.items() if source.is_relative_to(folder))
    return os.path.join(kernel_digest(*counted), source.parent.name)
