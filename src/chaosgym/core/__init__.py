"""Compiled kernels that serve every machine; they know numpy and numba only.

Compiled code is cached on disk in a folder named after the content of these sources. Numba itself looks only at the
file of the function that is called, and would keep serving old machine code after an edit in a helper.
"""

import hashlib
import os
import tempfile
from pathlib import Path

from numba import config


def source_digest(*folders: Path) -> str:
    """Hash of all Python sources in some folders and below."""
    sources = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]


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

KERNEL_CACHE = os.path.join(
    WANTED_CACHE if _is_writable(WANTED_CACHE) else tempfile.mkdtemp(prefix="chaosgym-kernels-"),
    source_digest(Path(__file__).parent),
)
"""Folder of the compiled kernels: in a new temporary folder where the wanted one is read-only or the disk is full."""

_previous_cache_folder = config.CACHE_DIR
config.CACHE_DIR = KERNEL_CACHE
try:
    from chaosgym.core import (  # noqa: F401
        batch,
        contact,
        cubic,
        cycle,
        event_tables,
        events,
        first_fall,
        fixed_step,
        joint_cycle,
        joint_events,
        joint_run,
        joint_tables,
        lanes,
        modal_impact,
        modal_model,
        modal_run,
        modal_stay,
        propagator,
        restitution,
        status,
        tangent,
        varied,
    )
finally:
    config.CACHE_DIR = _previous_cache_folder
