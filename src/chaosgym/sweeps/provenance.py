"""Provenance of rows: version, sources, packages and processor. The same ones give the same bytes again."""

import platform
import subprocess
from functools import cache
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding

from chaosgym.core import source_digest
from chaosgym.version import __version__

SOURCES = Path(__file__).resolve().parents[1]

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "pyarrow")


@cache
def provenance() -> dict[str, str]:
    """Describe this installation in words."""
    return {
        "chaosgym": __version__,
        "commit": source_commit(),
        "physics": "-".join(source_digest(SOURCES / floor) for floor in ("core", "machines")),
        "python": platform.python_version(),
        **{name: version(name) for name in PACKAGES},
        "platform": f"{platform.system()} {platform.machine()}",
        "processor": str(llvmlite.binding.get_host_cpu_name()),
    }


def source_commit() -> str:
    """Commit that last changed the package's sources; "+" if they have changed since, "unknown" without Git."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(SOURCES), *arguments, "--", "."]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        commit = git("log", "-1", "--format=%H")
        return f"{commit}{'+' if git('status', '--porcelain') else ''}" if commit else "unknown"
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
