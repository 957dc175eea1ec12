"""Arrays that the kernels read: a mechanism whose matrices are held over bins of an angle."""

from typing import NamedTuple

import numpy as np

FORCING_TERMS = 4
"""Coefficients of the forcing polynomial: a cubic."""

LINEAR, HERTZ = 0.0, 1.5
"""Exponents of the penetration: of Hertz's law, and what stands for a linear spring and damper."""


class BinnedModel(NamedTuple):
    """Arrays of a mechanism with n coordinates and m contact channels.

    Attributes
    ----------
    bin_duration : float
        Time [s] in which the drive turns through one bin.
    bins : int
        How many there are.
    steps : int
        Looks in a bin, of eight intervals each.
    contact_rate : float
        Angular frequency of the masses next to the closed contacts [rad/s].
    order : int
        Order of the Taylor series that sums an interval to round-off.
    spectrum : float
        Largest modulus of an eigenvalue of the motion [1/s].
    row : (m, n)
        Displacement of each channel per unit coordinate.
    gap, stiffness, damping : (m,)
        Clearance [m], contact stiffness [N/m] and damping [N s/m] of each channel.
    share : (bins, m)
        Factor of both in each bin; no rows where it is 1 in all.
    two_sided : (m,) bool
        True if the channel has a surface on either side, False if only where row . p is positive.
    radix : int
        2 where both sides of a channel share their matrices, 3 where friction sets them apart.
    reading : (m, 3)
        Contact force of the monitored joint (along, upward or across, sideways) per newton on a channel's positive
        side; zero for the channels of another joint.
    reach : (m,)
        Length of each channel's reading.
    display : (n,)
        Displacement of the monitored joint per unit coordinate.
    anchor : (radix^m, n, m)
        Places of the coordinates, per unit of clearance, at which the closed channels just touch.
    table : (radix^m * bins * length,)
        Rows of ``TablePlaces`` for every contact set and bin.
    """

    bin_duration: float
    bins: int
    steps: int
    contact_rate: float
    order: int
    spectrum: float
    row: np.ndarray
    gap: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    share: np.ndarray
    two_sided: np.ndarray
    radix: int
    reading: np.ndarray
    reach: np.ndarray
    display: np.ndarray
    anchor: np.ndarray
    table: np.ndarray


class TaylorModel(NamedTuple):
    """Arrays of a mechanism with n coordinates, J joints and R rows.

    Lanes are what the R rows read, then the n coordinates, rounded up to a multiple of 8.

    Attributes
    ----------
    bin_duration : float
        Time [s] in which the drive turns through one bin.
    steps : int
        Length of a bin over that of the longest piece.
    longest : float
        Longest span [s] for which a series is stable.
    tolerance : float
        Last terms of the series of velocities at the end of a span [m/s].
    contact_rate : float
        Angular frequency of the masses next to the closed contacts [rad/s].
    acceleration : (bins, 2n + 4 + R + S, lanes)
        Second derivative per unit (p, p', 1, x, x^2, x^3), x being the time in the bin over its duration, per newton
        on the surface along each row, and per newton of each of S frictions.
    first : (J + 1,) int
        Joint j owns the rows first[j] to first[j + 1] - 1.
    row : (R, n)
        Displacement in each direction of a joint per unit coordinate.
    gap, stiffness, damping : (J,)
        Clearance [m]; k [N/m] and d [N s/m], or K [N/m^n] and chi [s/m].
    exponent : (J,)
        LINEAR, or n of the penetration.
    slides : (J,) int
        Friction of a joint's force among the S, or -1.
    two_sided : (J,) bool
        False if a joint with one row has a surface only where row . p is positive.
    reading : (R, 3)
        Contact force of the monitored joint (along, upward or across, sideways) per newton along each row.
    monitored : (J,) bool
        True for the joints that are recorded.
    display : (n,)
        Displacement of the monitored joint per unit coordinate.
    """

    bin_duration: float
    steps: int
    longest: float
    tolerance: float
    contact_rate: float
    acceleration: np.ndarray
    first: np.ndarray
    row: np.ndarray
    gap: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    exponent: np.ndarray
    slides: np.ndarray
    two_sided: np.ndarray
    reading: np.ndarray
    monitored: np.ndarray
    display: np.ndarray
