"""The option ``--plot [FILE]``: one picture of what a command found."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNNAMED = "-"
"""Stands for a file that the user did not name."""


def plot_option(
    *names: str, formats: str = ".png, .svg or .pdf"
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """``--plot``; the function receives ``plot``: what was written, ``UNNAMED``, or None."""
    return click.option(
        "--plot",
        *names,
        "plot",
        is_flag=False,
        flag_value=UNNAMED,
        metavar="[FILE]",
        help=f"Draw a picture ({formats}); without FILE into a new file of the current folder.",
    )


def picture_path(plot: str | None, stem: str, formats: tuple[str, ...] | None = None) -> Path | None:
    """Path of the picture, checked before anything is computed; None without ``--plot``.

    A file that the user named is replaced, one that the user did not name never is.
    """
    if plot is None:
        return None
    from chaosgym.plotting.picture_file import FORMATS, check_picture, free_name

    return free_name(stem) if plot == UNNAMED else check_picture(Path(plot), formats or FORMATS)


def draw(path: Path | None, figure: Callable[[], "Figure"], result: dict[str, Any], lines: list[str]) -> None:
    """Save the figure, if one was asked for, and say where."""
    if path is None:
        return
    from chaosgym.plotting.picture_file import save_picture

    save_picture(figure(), path)
    result["plot"] = str(path)
    lines.append(f"picture: {path}")
