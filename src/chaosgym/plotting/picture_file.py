"""Files of pictures: PNG, SVG or PDF by the end of the name, whole or not at all."""

from pathlib import Path

from matplotlib.figure import Figure

from chaosgym.errors import ChaosgymError
from chaosgym.files import write_atomically

FORMATS = (".png", ".svg", ".pdf")

DOTS_PER_INCH = 200


def check_picture(path: Path, formats: tuple[str, ...] = FORMATS) -> Path:
    """Return the path if a picture may be written there.

    Raises
    ------
    ChaosgymError
        If its name ends in another format, or its folder is missing.
    """
    if path.suffix.lower() not in formats:
        raise ChaosgymError(
            f"{path} is no name of a picture; allowed: names that end in {', '.join(formats)}, or none at all "
            "as the last option of the line"
        )
    if not path.absolute().parent.is_dir():
        raise ChaosgymError(f"{path.absolute().parent} is no folder; choose another file")
    return path


def free_name(stem: str, folder: Path | None = None) -> Path:
    """Path of a PNG file that does not exist: stem.png, stem-2.png, stem-3.png ... in the current folder."""
    folder = folder or Path()
    path, number = folder / f"{stem}.png", 1
    while path.exists():
        number += 1
        path = folder / f"{stem}-{number}.png"
    return path


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure; the same figure gives the same bytes."""
    kind = path.suffix.lower().removeprefix(".")
    dateless = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    write_atomically(path, lambda file: figure.savefig(file, format=kind, dpi=DOTS_PER_INCH, metadata=dateless))
