"""The command ``info``: versions and folders in use."""

import click

from chaosgym.cli.output import AS_JSON, emit
from chaosgym.machines import MACHINES
from chaosgym.version import __version__


@click.command()
@AS_JSON
def info(as_json: bool) -> None:
    """Print versions and folders, for a bug report."""
    import platform
    from importlib import metadata

    from chaosgym.core.kernel_cache import KERNEL_CACHE, ROOT

    packages: dict[str, str | None] = {}
    for package in ("numpy", "scipy", "numba", "gymnasium", "pyarrow", "matplotlib", "torch", "stable-baselines3"):
        try:
            packages[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            packages[package] = None
    result = {
        "version": __version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machines": sorted(MACHINES),
        "packages": packages,
        "kernel_cache": KERNEL_CACHE,
    }
    emit(
        result,
        as_json,
        lambda: [
            f"chaosgym {__version__} on Python {result['python']}, {result['platform']}",
            "machines: " + ", ".join(MACHINES),
            *(f"{package:18s} {version or 'not installed'}" for package, version in packages.items()),
            f"kernel cache: {ROOT}",
        ],
    )
