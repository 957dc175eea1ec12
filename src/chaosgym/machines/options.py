"""Options of a machine on the command line: short names in shop-floor units for some of its fields."""

from collections.abc import Mapping
from typing import Any, NamedTuple


class Number(NamedTuple):
    """A number: the field that it sets, its unit on the command line, and how many SI units that is.

    ``joints`` are the words of ``--clearance-joint`` with which it makes sense; all if there are none.
    """

    field: str
    unit: str
    factor: float = 1.0
    joints: tuple[str, ...] = ()


class Choice(NamedTuple):
    """A word: the fields that each word sets, and the options that it redirects to another field."""

    words: Mapping[str, Mapping[str, Any]]
    redirects: Mapping[str, Mapping[str, str]] = {}
    joints: tuple[str, ...] = ()


Option = Number | Choice
