"""Build hook: machine code of the kernels, compiled into the package when a wheel is built or a clone is installed.

It takes minutes the first time and a second where it is there already. ``CHAOSGYM_KERNELS=none`` leaves it out; so does
a failure, with a warning: kernels are then compiled where they are first called.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Kernels(BuildHookInterface):  # type: ignore[type-arg]
    """Compiles the kernels, and names the wheel after the Python and the platform that they are for."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile what is missing, before files are collected."""
        if os.environ.get("CHAOSGYM_KERNELS") == "none":
            return
        # pip's own folders of the build come after ours
        folders = os.pathsep.join(filter(None, (str(Path(self.root, "src")), os.environ.get("PYTHONPATH"))))
        command = [sys.executable, "-m", "chaosgym.kernels"]
        if subprocess.run(command, cwd=self.root, env={**os.environ, "PYTHONPATH": folders}, check=False).returncode:
            self.app.display_warning("kernels are not compiled; each is when it is first called")
        elif version == "standard":
            build_data["artifacts"].append("/src/chaosgym/compiled/")
            build_data["pure_python"], build_data["infer_tag"] = False, True
