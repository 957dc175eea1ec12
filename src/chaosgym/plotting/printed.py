"""A page as a PDF, by the browser of this computer: what lays pages out elsewhere fails on some reports."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from chaosgym.errors import DesignError

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "chrome",
    "msedge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)
"""Programs that print a page without a window; the first one that is there is taken."""

SECONDS = 120
"""After which a browser is given up."""


def printing_browser() -> str:
    """Path of a browser that prints.

    Raises
    ------
    DesignError
        If none is found.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise DesignError("a PDF needs Chromium, Chrome or Edge, and none is found; write .html and print it")
    return found


def print_page(page: str, path: Path) -> None:
    """Print a page into a PDF file.

    Raises
    ------
    DesignError
        If no browser is found, or it prints nothing.
    """
    browser = printing_browser()
    with tempfile.TemporaryDirectory(prefix="chaosgym-") as folder:
        source, target = Path(folder, "report.html"), Path(folder, "report.pdf")
        source.write_text(page, encoding="utf-8")
        command = [browser, "--headless", "--disable-gpu", "--no-first-run", f"--user-data-dir={folder}/profile"]
        command += ["--no-pdf-header-footer", f"--print-to-pdf={target}", source.as_uri()]
        if hasattr(os, "geteuid") and os.geteuid() == 0:  # Chromium has no sandbox for root
            command.insert(1, "--no-sandbox")
        try:
            subprocess.run(command, capture_output=True, timeout=SECONDS, check=False)
            path.write_bytes(target.read_bytes())
        except (OSError, subprocess.TimeoutExpired):
            raise DesignError(f"{browser} printed no PDF; write .html and print it") from None
