"""Production of figures: computed or read back, drawn, compared with the print, and written whole or not at all."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from chaosgym.errors import ChaosgymError, SimulationError
from chaosgym.files import write_atomically
from thesis.cache import kept_arrays
from thesis.figures.computations import Computation, Data
from thesis.figures.figure import Finding, ThesisFigure
from thesis.figures.printed import contradiction

RESULTS = "results"
"""Folder beside the figures that keeps what was computed."""

LOWEST_RESOLUTION, HIGHEST_RESOLUTION = 0.1, 20.0


@dataclass(frozen=True)
class Drawn:
    """A figure that was drawn.

    ``path`` of the picture; ``findings`` against the print; ``seconds`` it took; ``error`` in words if it failed.
    """

    figure: ThesisFigure
    path: Path
    findings: tuple[Finding, ...]
    seconds: float
    error: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "id": self.figure.id,
            "title": self.figure.title,
            "shows": self.figure.shows,
            "remark": self.figure.remark,
            "path": str(self.path),
            "seconds": round(self.seconds, 3),
            "error": self.error,
            "findings": [
                {**finding._asdict(), "contradiction": contradiction(finding.targets)} for finding in self.findings
            ],
        }

    def lines(self) -> list[str]:
        """Return the findings for people."""
        head = f"figure {self.figure.id}  {self.figure.title}" + (f": {self.error}" if self.error else "")
        signs = {True: "agrees ", False: "differs", None: "       "}
        judged = [(None if contradiction(found.targets) else found.agrees, found) for found in self.findings]
        return [head, *(f"  {signs[agrees]}  {found.printed}; here {found.here}" for agrees, found in judged)]


def picture_path(figure: ThesisFigure, folder: Path) -> Path:
    """File of a figure."""
    return folder / f"figure-{figure.id}.png"


def draw_figures(
    figures: Sequence[ThesisFigure],
    folder: str | Path,
    *,
    resolution: float = 1.0,
    results: str | Path | None = None,
    overwrite: bool = False,
    workers: int | None = None,
    progress: bool = False,
) -> list[Drawn]:
    """Draw figures into a folder.

    Parameters
    ----------
    figures
        Which; see ``registry.chosen``.
    folder
        Made if it is not there.
    resolution
        1 draws the usual number of points, 2 twice as many along each axis.
    results
        Folder that keeps what is computed; ``results`` beside the pictures by default.
    overwrite
        Replace pictures that exist.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Returns
    -------
    list of Drawn, one a figure; one that can't be computed has its error in words and no picture.

    Raises
    ------
    ChaosgymError
        If a picture exists and may not be replaced, or the resolution is out of range. Nothing is computed then.
    """
    folder = Path(folder)
    if not LOWEST_RESOLUTION <= resolution <= HIGHEST_RESOLUTION:
        raise ChaosgymError(
            f"resolution = {resolution:g} is out of range; allowed: {LOWEST_RESOLUTION:g} to {HIGHEST_RESOLUTION:g}"
        )
    there = [picture_path(figure, folder) for figure in figures if picture_path(figure, folder).exists()]
    if there and not overwrite:
        raise ChaosgymError(f"{there[0]} exists{_and_others(len(there) - 1)}; replace with --overwrite")
    kept = Path(results) if results is not None else folder / RESULTS
    folder.mkdir(parents=True, exist_ok=True)
    bar = tqdm(figures, disable=not progress, unit="figure")
    drawn = []
    for figure in bar:
        bar.set_description(f"figure {figure.id}")
        drawn.append(_draw(figure, picture_path(figure, folder), resolution, kept, workers))
    return drawn


def _and_others(count: int) -> str:
    return f", and {count} other{'s' * (count > 1)}" if count else ""


def _draw(figure: ThesisFigure, path: Path, resolution: float, kept: Path, workers: int | None) -> Drawn:
    began = time.perf_counter()
    try:
        parts = {name: computed(part, kept, workers) for name, part in figure.parts(resolution).items()}
    except SimulationError as error:
        return Drawn(figure, path, (), time.perf_counter() - began, str(error))
    picture = figure.draw(parts)
    write_atomically(
        path, lambda temporary: picture.savefig(temporary, format="png", dpi=110, metadata={"Software": ""})
    )
    return Drawn(figure, path, tuple(figure.findings(parts)), time.perf_counter() - began)


def computed(computation: Computation, folder: Path, workers: int | None = None) -> Data:
    """Result of a computation, kept in a folder under its description."""
    return kept_arrays(repr(computation), folder, lambda: computation.run(workers))
