"""The periodic drive of a machine: forces, unbalances and motions of the base as harmonics of the operating cycle."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.loads import LARGEST, MOST_HARMONICS, Cycle
from chaosgym.machines.modal_machine.structure import BASE, Structure
from chaosgym.numbers import numbers, whole

KINDS = {"force": "N", "unbalance": "kg m", "displacement": "m", "acceleration": "m/s^2"}
"""What a drive prescribes, and its unit: a force; mass times eccentricity, whose force grows with the square of the
harmonic's frequency; a motion of the base, with which the stops move."""


class Drive(NamedTuple):
    """A drive at one point.

    ``kind`` of ``KINDS``; ``harmonics`` (order, cosine, sine) with amplitudes in the kind's unit; ``mean`` what is
    constant, and ``left_out`` by how much samples differ from their harmonics at the most, in that unit.

    Examples
    --------
    >>> chaosgym.Drive.sine("force", "tip", 8.9).harmonics
    ((1, 0.0, 8.9),)
    """

    kind: str
    at: str
    harmonics: tuple[tuple[int, float, float], ...]
    mean: float = 0.0
    left_out: float = 0.0

    @classmethod
    def sine(cls, kind: str, at: str, amplitude: float, harmonic: int = 1, angle: float = 0.0) -> "Drive":
        """Drive amplitude sin(harmonic w t + angle), the angle in rad."""
        return cls(kind, at, Cycle.sine(amplitude, harmonic, angle).harmonics)

    @classmethod
    def sampled(cls, kind: str, at: str, values: ArrayLike, harmonics: int | None = None) -> "Drive":
        """Drive of values at equal intervals over one cycle, the first at its beginning; see ``Cycle.sampled``.

        Raises
        ------
        ParameterError
            If there are too few values for so many harmonics.
        """
        return cls.over(kind, at, Cycle.sampled(f"samples of {kind}", values, harmonics, KINDS.get(kind, "")))

    @classmethod
    def over(cls, kind: str, at: str, cycle: Cycle) -> "Drive":
        """Drive of values over a cycle."""
        return cls(kind, at, cycle.harmonics, cycle.mean, cycle.left_out)


def checked(drive: Drive) -> Drive:
    """Return the drive.

    Raises
    ------
    ParameterError
        If its kind, point or a harmonic is not allowed.
    """
    if drive.kind not in KINDS:
        raise ParameterError(f"a drive has no kind {drive.kind!r}; allowed: {', '.join(KINDS)}")
    if (drive.kind in ("displacement", "acceleration")) != (drive.at == BASE):
        rule = f"'{BASE}'" if drive.at != BASE else f"a point other than '{BASE}'"
        raise ParameterError(f"{drive.kind} at {drive.at!r}: allowed: at {rule}")
    for order, *amplitudes in drive.harmonics:
        whole("harmonic", order, 1, MOST_HARMONICS)
        numbers(drive.kind, amplitudes, -LARGEST, LARGEST, KINDS[drive.kind])
    if drive.mean and drive.kind == "unbalance":
        raise ParameterError(f"the mean of {drive.kind} at {drive.at!r} is not 0; allowed: of all other kinds")
    return drive


def drive_notes(drives: Iterable[Drive]) -> list[str]:
    """What is to be said of sampled drives: a mean that changes nothing, and what their harmonics leave out."""
    told = []
    for drive in drives:
        size = max((math.hypot(*pair) for _, *pair in drive.harmonics), default=0.0)
        if drive.kind == "displacement" and abs(drive.mean) > 1e-9 * size:
            told.append(f"the base's mean displacement, {drive.mean:.4g} in SI, takes the stops along: it is left out")
        missed = Cycle(drive.mean, drive.harmonics, drive.left_out).note(f"the {drive.kind} at {drive.at!r}")
        told += [missed] if missed else []
    return told


def modal_drive(structure: Structure, drives: Iterable[Drive]) -> tuple[Array, Array]:
    """Modal forces of harmonics, (2, H, 2, n) as in ``ModalImpactModel.drive``, and the constant one, (n,)."""
    drives = list(drives)
    n, highest = len(structure.angular_frequency), max((h[0] for d in drives for h in d.harmonics), default=1)
    forces, static = np.zeros((2, highest, 2, n)), np.zeros(n)
    for drive in drives:
        shape = structure.shape(drive.at)
        # a base that is moved takes structure and stops along; one under constant acceleration weighs on each mode
        static += {"force": 1.0, "acceleration": -1.0}.get(drive.kind, 0.0) * drive.mean * shape
        if not shape.any():
            raise ParameterError(f"the drive at {drive.at!r} moves no mode: every shape is 0 there")
        grows = int(drive.kind in ("unbalance", "displacement"))
        for order, *amplitudes in drive.harmonics:
            factor = float(order**2) if grows else -1.0 if drive.kind == "acceleration" else 1.0
            for part, amplitude in enumerate(amplitudes):
                forces[grows, order - 1, part] += factor * amplitude * shape
    return forces, static
