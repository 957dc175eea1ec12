"""Linear combinations of displacements as a file writes them: ``motor - 3 gear``, ``50 mm pinion + 80 mm wheel``."""

import re
from collections.abc import Collection
from typing import NamedTuple

from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import suggestion
from chaosgym.units import units_of

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_WORD = re.compile(rf"[-+]|{_NUMBER}(?:/{_NUMBER})?(?![\w.])|[^\s+\-*]+")
_FACTOR = re.compile(rf"({_NUMBER})(?:/({_NUMBER}))?")


class Term(NamedTuple):
    """A factor times the displacement of a point; ``lever`` if the factor is a length, which turns rad into m."""

    factor: float
    point: str
    lever: bool = False


def terms_of(place: str, points: Collection[str] | None = None) -> list[Term]:
    """Terms of a linear combination of the displacements of some points, or of any.

    A term is a sign, a factor such as ``3``, ``1/3`` or ``50 mm`` if it is not 1, and a point. A factor with a unit of
    length is the radius at which a turning point moves.

    Raises
    ------
    ParameterError
        If there is no such point, of which the nearest one is suggested, or a term has none.

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.places import terms_of
    >>> terms_of("motor - 3 gear", ["motor", "gear"])[1]
    Term(factor=-3.0, point='gear', lever=False)
    """
    if points is not None and place in points:
        return [Term(1.0, place)]
    terms, sign, words = [], 1.0, list[str]()
    for word in [*_WORD.findall(place), "+"]:
        if word not in ("-", "+"):
            words.append(word)
            continue
        if words:
            terms.append(_term(sign, words, place, points))
        sign, words = -1.0 if word == "-" else 1.0, []
    return terms


def _term(sign: float, words: list[str], place: str, points: Collection[str] | None) -> Term:
    *before, point = words
    if points is not None and point not in points:
        raise ParameterError(f"there is no point {point!r}{_instead(point, points)}")
    lengths = units_of("m")
    number = _FACTOR.fullmatch(before[0]) if before else None
    if before and (number is None or len(before) > 2 or (len(before) == 2 and before[1] not in lengths)):
        raise ParameterError(
            f"{place!r} has the term {' '.join(words)!r}; allowed: a point, before it a factor such as 3, 1/3 or 50 mm"
        )
    size = lengths[before[1]] if len(before) == 2 else 1.0
    factor = float(number[1]) / float(number[2] or 1.0) if number else 1.0
    return Term(sign * factor * size, point, len(before) == 2)


def _instead(point: str, points: Collection[str]) -> str:
    """End of a message about a point that there is not."""
    name, _, divisor = point.partition("/")
    if name in points and _FACTOR.fullmatch(divisor):
        return f"; a factor stands before its point: 1/{divisor} {name}"
    if point == "base":
        return "; a base that moves needs base in [structure.shapes], or structure.base beside matrices"
    return suggestion(point, points)
