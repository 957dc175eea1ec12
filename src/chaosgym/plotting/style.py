"""One look for every picture: colours that colour-blind readers tell apart, and files in PNG, SVG or PDF."""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chaosgym.errors import ChaosgymError
from chaosgym.files import check_place, write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, ACCENT, BAD, MUTED, PALE = "#22303c", "#1f6f8b", "#b3392f", "#8a97a3", "#e6eaee"
"""Text, data, what is bad, what stands behind, and grids and stops."""

NATURE_COLOURS = {"periodic": ACCENT, "quasiperiodic": "#8e5ea2", "chaotic": "#d1495b", "undetermined": MUTED}
"""One colour a nature."""

TYPE_COLOURS = {"I": "#3b7dd8", "II": "#f2a93b", "III": "#d1495b", "undetermined": "#bbbbbb"}
"""One colour a response type."""

STYLE: Any = {
    "font.size": 9.5,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": PALE,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.hashsalt": "chaosgym",
    "svg.fonttype": "path",
}
"""Settings for ``matplotlib.rc_context`` around a figure."""


def figure_of(width: float = 6.2, height: float = 3.7) -> "Figure":
    """Empty figure of a width and height [in]."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


FORMATS = (".png", ".svg", ".pdf")

DOTS_PER_INCH = 200


def check_picture(path: Path, formats: tuple[str, ...] = FORMATS) -> Path:
    """Return the path if a picture may be written there.

    Raises
    ------
    ChaosgymError
        If its name ends in another format, or its folder is missing or takes no file.
    """
    if path.suffix.lower() not in formats:
        raise ChaosgymError(
            f"{path} is no name of a picture; allowed: names that end in {', '.join(formats)}, or none at all "
            "as the last option of the line"
        )
    if not path.absolute().parent.is_dir():
        raise ChaosgymError(f"{path.absolute().parent} is no folder; choose another file")
    check_place(path)
    return path


def free_name(stem: str) -> Path:
    """Path of a PNG file that does not exist: stem.png, stem-2.png, stem-3.png ... in the current folder."""
    path, number = Path(f"{stem}.png"), 1
    while path.exists():
        number += 1
        path = Path(f"{stem}-{number}.png")
    return path


def save_picture(figure: "Figure", path: Path) -> None:
    """Write a figure; the same figure gives the same bytes."""
    kind = path.suffix.lower().removeprefix(".")
    dateless = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    drawn = BytesIO()  # what writes PDF ends in another error where the disk is full
    figure.savefig(drawn, format=kind, dpi=DOTS_PER_INCH, metadata=dateless)
    write_atomically(path, lambda file: file.write_bytes(drawn.getvalue()))
