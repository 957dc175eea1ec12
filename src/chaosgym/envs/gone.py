"""The environments of version 0, of which a message is left."""

from typing import Any, NoReturn

from chaosgym.errors import ParameterError


def refuse(successor: str, **_: Any) -> NoReturn:
    """Refuse to make an environment that is gone.

    Raises
    ------
    ParameterError
        Always; names the id to use instead.
    """
    raise ParameterError(
        f"{successor.replace('-v1', '-v0')} is gone: its Type III was a table's, not the motion's; use {successor}"
    )
