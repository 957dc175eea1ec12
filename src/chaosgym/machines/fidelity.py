"""The fidelity ladder: named rungs of a machine's model, from the cheapest to the reference.

    ImpactBeam(fidelity="draft", clearance=0.1e-3)

A rung is a short name for some fields that are set together and that decide accuracy alone. The machine keeps the
fields, not the name, so that ``dataclasses.replace`` and ``with_settings`` may change any of them afterwards.
"""

from collections.abc import Mapping
from dataclasses import InitVar, dataclass
from typing import Any, ClassVar, Self

from chaosgym.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class FidelityLadder:
    """Gives a machine the keyword ``fidelity``.

    Raises
    ------
    ParameterError
        If the rung is unknown, or if a field that it sets is given too; names both.
    """

    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]]
    """Fields that each rung sets, from the cheapest rung to the reference."""
    former_rungs: ClassVar[Mapping[str, str]] = {}
    """Rungs of earlier versions, and what stands for them now."""

    fidelity: InitVar[str | None] = None

    def __new__(cls, **given: Any) -> Self:
        """Refuse a rung together with a field that it sets: only here is it known what was given."""
        expand_fidelity(cls, given)
        return super().__new__(cls)

    def __post_init__(self, fidelity: str | None) -> None:
        for name, value in expand_fidelity(type(self), {"fidelity": fidelity}).items():
            object.__setattr__(self, name, value)

    @property
    def rung(self) -> str | None:
        """Rung of the ladder whose fields this machine has; None if it stands beside the ladder."""
        for rung, fields in self.fidelity_ladder.items():
            if all(getattr(self, name) == value for name, value in fields.items()):
                return rung
        return None


def expand_fidelity(machine: Any, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings with ``fidelity`` replaced by the fields that it sets.

    Raises
    ------
    ParameterError
        If the rung is unknown, or if a field that it sets is given too; names both.
    """
    others = {name: value for name, value in settings.items() if name != "fidelity"}
    rung = settings.get("fidelity")
    if rung is None:
        return others
    ladder = getattr(machine, "fidelity_ladder", {})
    former = getattr(machine, "former_rungs", {})
    if rung in former:
        raise ParameterError(f"fidelity = {rung!r} is no rung any more; allowed: {former[rung]}")
    if rung not in ladder:
        raise ParameterError(f"fidelity = {rung!r} is not one of {', '.join(ladder)}")
    for name, value in ladder[rung].items():
        if name in others:
            raise ParameterError(
                f"fidelity = {rung!r} sets {name} = {value!r}, and {name} = {others[name]!r} is given too; "
                "allowed: one of the two"
            )
    return {**others, **ladder[rung]}
