"""Results as plain values: what JSON holds of a record, an array or a number."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np


def plain(value: Any) -> Any:
    """Return a value as JSON holds it.

    Records become objects, without private fields; arrays and tuples become lists; numbers that are not finite become
    None. What has ``as_dict`` says itself what it shows.

    Examples
    --------
    >>> from chaosgym.plain import plain
    >>> plain({"peaks": np.array([1.5, np.nan]), "sides": (1, 2)})
    {'peaks': [1.5, None], 'sides': [1, 2]}
    """
    if isinstance(value, float):
        return value if isfinite(value) else None
    if value is None or isinstance(value, str | int):
        return value
    if hasattr(value, "as_dict"):
        return value.as_dict()
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if hasattr(value, "_asdict"):
        value = value._asdict()
    elif is_dataclass(value):
        value = {name: getattr(value, name) for name in _public(value)}
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    return [plain(each) for each in value]


def _public(record: Any) -> list[str]:
    return [each.name for each in fields(record) if not each.name.startswith("_")]


class Result:
    """A result that JSON shows."""

    shows: ClassVar[str] = ""
    """Attributes, divided by spaces; ``name=attribute``, or ``name=attribute.of_it``, renames one. Else all fields."""

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; None stands for what is no finite number."""
        pairs = [name.partition("=") for name in self.shows.split() or _public(self)]
        return {name: plain(attrgetter(attribute or name)(self)) for name, _, attribute in pairs}
