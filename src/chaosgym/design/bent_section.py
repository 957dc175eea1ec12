"""A section of a part that bends: where it is, what its material bears, and the stress that a motion puts on it.

Each stress cycle, of amplitude s_a about the mean s_m, counts as a reversed one of amplitude s_ar, and takes a share of
the life by the line of Basquin through (s_D, N_D) with slope k:

    Goodman    s_ar = s_a / (1 - s_m / S_u)
    Gerber     s_ar = s_a / (1 - (s_m / S_u)^2)
    Basquin    N = N_D (s_D / s_ar)^k

Means below zero are taken as zero. There is no endurance limit: the line goes on.

References
----------
R. G. Budynas, J. K. Nisbett, Shigley's Mechanical Engineering Design, 9th ed., sections 6-8, 6-10, 6-12 and 6-15.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import DesignError, ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameter, validate
from chaosgym.numbers import number

MEANS = ("goodman", "gerber", "none")


class Section(NamedTuple):
    """Where a part bends; one of three.

    Attributes
    ----------
    at
        Position [m] on the machine's own beam, from its pivot on; with ``link`` on that link, from its start on.
    link
        Name of a link of a mechanism that bends.
    turn, span
        Turn of one point against another, such as "turn2 - turn1", over the distance [m] between them.
    curvatures
        Modal curvatures phi'' [kg^-1/2 m^-2], of each mode.
    """

    at: float | None = None
    link: str = ""
    turn: str = ""
    span: float = 0.0
    curvatures: tuple[float, ...] = ()

    @property
    def told(self) -> str:
        """Which one it is, for people."""
        if self.at is not None:
            return f"at {1e3 * self.at:g} mm" + (f" of {self.link}" if self.link else "")
        return f"by the turn {self.turn}" if self.turn else "by the modal curvatures that are stated"


def _assumed(default: Any, **about: Any) -> Any:
    return parameter(default, provenance="assumed", **about)


@dataclass(frozen=True, kw_only=True)
class Bending:
    """Data of a section and of its material, in SI units.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range.
    """

    section: Section
    amplitude: float = _assumed(2.5e8, unit="Pa", low=1e3, high=1e11, source="an example")
    """Reversed stress [Pa] that the part bears for ``cycles``; s_D."""
    cycles: float = _assumed(1.0, unit="Mcycles", low=1e-3, high=1e4, source="an example")
    """Stress cycles [10^6]; N_D."""
    slope: float = _assumed(5.0, low=1.0, high=50.0, source="an example")
    """Slope k of the S-N line."""
    ultimate: float = _assumed(6e8, unit="Pa", low=1e3, high=1e11, source="an example")
    """Ultimate tensile strength S_u [Pa]."""
    mean_stress: str = _assumed("goodman", choices=MEANS, source="the safer one of two")
    """How the mean stress counts."""
    notch_factor: float = _assumed(1.0, low=1.0, high=20.0, source="no notch")
    """Fatigue notch factor K_f, which multiplies the stress."""
    static_stress: float = _assumed(0.0, unit="Pa", low=-1e11, high=1e11, source="none")
    """Stress s_0 [Pa] that is there without any vibration, pull above zero."""
    uncertainty: float = _assumed(3.0, low=1.0, high=1e3, source="scatter of lives at one stress, Haibach")
    """Factor to which lives are known."""
    fibre: float = _assumed(0.0, unit="m", low=0.0, high=10.0, source="of the machine's own beam")
    """Distance c [m] of the outer fibre from the neutral one."""
    modulus: float = _assumed(0.0, unit="Pa", low=0.0, high=1e13, source="of the machine's own beam")
    """Young's modulus E [Pa]."""

    def __post_init__(self) -> None:
        validate(self)

    def cycles_at(self, reversed_amplitude: ArrayLike) -> Array:
        """Stress cycles that a reversed amplitude [Pa] takes, infinite for none.

        Examples
        --------
        >>> one = Bending(section=Section(at=0.1), amplitude=2e8, cycles=1.0, slope=5.0)
        >>> one.cycles_at([2e8, 4e8, 0.0]).tolist()
        [1000000.0, 31250.0, inf]
        """
        with np.errstate(divide="ignore", over="ignore"):
            return np.asarray(1e6 * self.cycles * (self.amplitude / np.asarray(reversed_amplitude)) ** self.slope)

    def reversed_amplitudes(self, amplitude: ArrayLike, mean: ArrayLike) -> Array:
        """Amplitudes [Pa] that about a mean of zero do the same damage; infinite from the ultimate strength on."""
        share = np.maximum(np.asarray(mean, dtype=float), 0.0) / self.ultimate
        left = {"goodman": 1.0 - share, "gerber": 1.0 - share**2, "none": np.ones_like(share)}[self.mean_stress]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(left > 0.0, np.asarray(amplitude) / left, np.inf)


def fibres(machine: Machine, bending: Bending) -> Array:
    """Stress (f, n) [Pa] at the outer fibres for each coordinate of a mechanism or each mode, without notch.

    The mass-normalised modes of a machine make it [Pa kg^-1/2 m^-1].

    Raises
    ------
    ParameterError
        If there is no such section on the machine.

    Examples
    --------
    >>> from chaosgym.design.bent_section import Bending, Section, fibres
    >>> upper, lower = fibres(chaosgym.ImpactBeam(), Bending(section=Section(at=0.1)))
    >>> upper.shape, bool(np.all(upper == -lower))
    ((6,), True)
    """
    section, parts = bending.section, machine.bending_parts
    if section.at is not None:
        where = "bending" if section.link else "bending.at"
        if section.link not in parts:
            links = ", ".join(filter(None, parts)) or "a link with a [link.NAME.beam]"
            own = f"{machine.name} has no beam of its own; allowed: impact-beam, or a link that bends"
            none = f"link {section.link!r} does not bend; allowed: {links}" if section.link else own
            raise ParameterError(f"{where}: {none}")
        try:
            return parts[section.link].stress(section.at, bending.fibre)
        except ParameterError as error:
            raise ParameterError(f"{where}: {error}") from None
    if machine.flexible is None:
        kind = "modes or matrices, of constant stiffness and without friction"
        raise ParameterError(f"[bending] is for a machine of {kind}; {machine.name} is none")
    bent = np.array(section.curvatures)
    if section.turn:
        try:
            bent = machine.shape_of(section.turn) / section.span
        except ParameterError as error:
            raise ParameterError(f"bending.turn: {error}") from None
    modes = len(machine.flexible.stiffness)
    if len(bent) != modes:
        raise ParameterError(f"bending.curvatures has {len(bent)} entries; allowed: {modes}, one a mode")
    upper = -bending.modulus * bending.fibre * bent
    return np.stack([upper, -upper])


REQUIRED = ("amplitude", "cycles", "slope")
"""What an S-N line is."""


def read_bending(values: Mapping[str, Any], machine: Machine) -> Bending:
    """Bending of a brief, in SI: an S-N line, a section of one of three kinds, and what the section's kind needs.

    Raises
    ------
    DesignError
        If something is missing.
    ParameterError
        If a value is out of its range, or the section is none of the machine.

    Examples
    --------
    >>> from chaosgym.design.bent_section import read_bending
    >>> line = {"amplitude": 2.5e8, "cycles": 1.0, "slope": 5.0, "ultimate": 6e8}
    >>> read_bending({"at": 0.1, **line}, chaosgym.ImpactBeam()).section.told
    'at 100 mm'
    """
    given = dict(values)
    for name in REQUIRED:
        if name not in given:
            raise DesignError(f"[bending] lacks {name}: an S-N line is an amplitude at so many cycles, and a slope")
    kinds = [name for name in ("at", "turn", "curvatures") if name in given]
    if len(kinds) != 1:
        raise DesignError(
            f"[bending] has {' and '.join(kinds) or 'no section'}; allowed: one of at, turn (with span), curvatures"
        )
    on_link = "link" in given
    links = ", ".join(filter(None, machine.bending_parts))
    if kinds == ["at"] and not on_link and links:
        raise DesignError(f"[bending] lacks link, the one that bends; allowed: {links}")
    if on_link and kinds != ["at"]:
        raise DesignError("[bending] has link, which goes with at, the place of the section on it")
    if given.get("mean_stress", "goodman") != "none" and "ultimate" not in given:
        raise DesignError('[bending] lacks ultimate, the tensile strength; or say mean_stress = "none"')
    needed = {"at": ("fibre",) if on_link else (), "turn": ("fibre", "modulus", "span")}
    for name in needed.get(kinds[0], ("fibre", "modulus")):
        if name not in given:
            raise DesignError(f"[bending] lacks {name}")
        number(f"bending.{name}", given[name], 0.0, inside=True)
    goes_with = {"fibre": "turn, curvatures or link", "modulus": "turn or curvatures", "span": "turn"}
    for name in needed.get(kinds[0], ("fibre", "modulus")):
        goes_with.pop(name)
    for name, what in goes_with.items():
        if name in given:
            raise DesignError(f"[bending] has {name}, which goes with {what}")
    section = Section(**{name: given.pop(name) for name in Section._fields if name in given})
    bending = Bending(section=section, **given)
    if not fibres(machine, bending).any():
        raise ParameterError(f"[bending]: no mode bends the section {section.told}")
    return bending
