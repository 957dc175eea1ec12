"""All figures, by their number in the thesis, in its order."""

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from chaosgym.errors import ChaosgymError
from thesis.figures import (
    beam_chaos,
    beam_flexibility,
    beam_forces,
    beam_maps,
    beam_responses,
    crank_design,
    crank_forces,
    crank_maps,
    crank_resonances,
    crank_responses,
    crank_tests,
)
from thesis.figures.figure import ThesisFigure

_MODULES = (
    beam_responses,
    beam_forces,
    beam_maps,
    beam_flexibility,
    beam_chaos,
    crank_responses,
    crank_forces,
    crank_maps,
    crank_resonances,
    crank_tests,
    crank_design,
)


def _place(figure: ThesisFigure) -> tuple[int, int]:
    chapter, number = figure.id.split(".")
    return int(chapter), int(number)


FIGURES: Mapping[str, ThesisFigure] = MappingProxyType(
    {figure.id: figure for figure in sorted((figure for module in _MODULES for figure in module.FIGURES), key=_place)}
)


def chosen(ids: Sequence[str]) -> list[ThesisFigure]:
    """Figures by number, in the order of the thesis; "all" or nothing gives every one.

    Raises
    ------
    ChaosgymError
        If there is no figure of a number; lists all.
    """
    if not ids or "all" in ids:
        return list(FIGURES.values())
    unknown = [name for name in ids if name not in FIGURES]
    if unknown:
        raise ChaosgymError(f"there is no figure {', '.join(unknown)}; there are:\n" + "\n".join(listing()))
    return [figure for name, figure in FIGURES.items() if name in ids]


def listing(figures: Iterable[ThesisFigure] = tuple(FIGURES.values())) -> list[str]:
    """Number and title of figures, one a line."""
    return [f"  {figure.id:<6} {figure.title}" for figure in figures]
