"""Members of a protocol: what one who implements it must give, and what it may give."""

from dataclasses import InitVar
from inspect import get_annotations
from typing import Any, ClassVar, get_origin

_CLASS_VARIABLE: Any = ClassVar


def members(protocol: type) -> dict[str, int]:
    """Public members that a class and its bases of the same package declare: to be given, and with a default.

    A class variable without a value must be given, as an abstract method must. What is final follows from the others,
    and an ``InitVar`` is an argument: neither can be given.
    """
    package = protocol.__module__.partition(".")[0]
    must, every = set(getattr(protocol, "__abstractmethods__", ())), set()
    for owner in protocol.__mro__:
        if owner.__module__.partition(".")[0] == package:
            annotated = get_annotations(owner)
            closed = {name for name, kind in annotated.items() if isinstance(kind, InitVar)}
            closed |= {name for name, value in owner.__dict__.items() if _is_final(value)}
            every |= {name for name in (*owner.__dict__, *annotated) if name not in closed and not name.startswith("_")}
            variables = {name for name, kind in annotated.items() if _CLASS_VARIABLE in (kind, get_origin(kind))}
            must |= {name for name in variables & every if not hasattr(protocol, name)}
    return {"must_give": len(must), "may_give": len(every - must)}


def _is_final(value: Any) -> bool:
    """Whether a method, or what a property calls, is marked as final."""
    return getattr(getattr(value, "fget", value), "__final__", False)
