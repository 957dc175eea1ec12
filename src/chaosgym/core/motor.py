"""Kernels of cranks under their motors: one cycle after the other by the balance of torques.

A step of crank angle takes the trapezium of the torques; the speed at its end is the root of a quadratic.
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.core.kernel import njit, part

GRID = 1e-3
"""Spacing of the speeds at which cycles are run, as a share: models of a machine are kept for each."""

TURNS = -1
"""In place of the step in which a crank stops, where it goes on."""


class Crank(NamedTuple):
    """A crank and what turns with it, at B equal steps of a revolution; in a batch, each with one more axis in front.

    Attributes
    ----------
    inertia, still, viscous : (B,)
        Of everything that turns [kg m^2]; torque that resists [N m], and that in proportion to the speed [N m s].
    torques, rates : (K,)
        The motor's curve: its torque [N m] at speeds [rad/s] from 0 on, straight lines between; none at the last.
    """

    inertia: np.ndarray
    still: np.ndarray
    viscous: np.ndarray
    torques: np.ndarray
    rates: np.ndarray


@part
def line_at(torques, rates, rate, shift):
    """Line of a motor's curve, which is moved down by a speed ``shift``, at a rate: torque at rest, and its fall."""
    i = 0
    while i < len(rates) - 2 and rate + shift >= rates[i + 1]:
        i += 1
    slope = (torques[i] - torques[i + 1]) / (rates[i + 1] - rates[i])
    return torques[i] + slope * (rates[i] - shift), slope


@njit(cache=True, nogil=True)
def revolution(inertia, still, viscous, torques, rates, set_rate, rate):
    """Turn a crank by one revolution from ``rate`` [rad/s], with a motor that gives no torque at ``set_rate``.

    Returns
    -------
    (stopped, rate, time, work, lowest, highest)
        Step in which it stops, or ``TURNS``; its rate at the end; time [s] and the motor's work [J]; ends of its rate.
    """
    steps, shift = len(still), rates[-1] - set_rate
    width = 2.0 * math.pi / steps
    time, work, low, high = 0.0, 0.0, rate, rate
    for k in range(steps):
        after = (k + 1) % steps
        start, slope = line_at(torques, rates, rate, shift)
        taken, half = slope + viscous[k], 0.5 * width * (slope + viscous[after])
        given = 2.0 * start - still[k] - still[after] - taken * rate
        left = 0.5 * inertia[k] * rate**2 + 0.5 * width * given
        square = half**2 + 2.0 * inertia[after] * left
        # a crank that does not gain from rest stands still
        if left <= 0.0 or square <= 0.0:
            return k, rate, time, work, low, high
        faster = (math.sqrt(square) - half) / inertia[after]
        time += 2.0 * width / (rate + faster)
        work += 0.5 * width * (2.0 * start - slope * (rate + faster))
        rate = faster
        low, high = min(low, rate), max(high, rate)
    return TURNS, rate, time, work, low, high


@njit(cache=True, nogil=True)
def turn_cranks(cranks, which, set_rates, last, rates, speeds, told, stalled):
    """Turn the cranks ``which`` (k,) of a batch of ``Crank``, from ``rates`` (N,) [rad/s] on, which go along.

    ``set_rates`` (k,) [rad/s] at which the motors give no torque, at most those of their curves. Written are
    ``speeds`` (k, cycles) [rpm], the mean of each cycle; ``told`` (k, 3), mean speed [rpm], torque [N m] and power [W]
    of the ``last`` cycles; and whether each has ``stalled`` (k,). One that stalls is told at rest; its speeds go on as
    they were, so that its gaps can be moved.
    """
    cycles = speeds.shape[1]
    for k, i in enumerate(which):
        torques, curve = cranks.torques[i], cranks.rates[i]
        set_rate = min(set_rates[k], curve[-1])
        speeds[k] = 30.0 / math.pi * set_rate
        time, work, rate = 0.0, 0.0, rates[i]
        stalled[k] = False
        for cycle in range(cycles):
            stopped, rate, spent, done, _, _ = revolution(
                cranks.inertia[i], cranks.still[i], cranks.viscous[i], torques, curve, set_rate, rate
            )
            if stopped != TURNS:
                stalled[k], rates[i] = True, 0.0
                told[k, 0], told[k, 1], told[k, 2] = 0.0, line_at(torques, curve, 0.0, curve[-1] - set_rate)[0], 0.0
                break
            speeds[k, cycle:] = 60.0 / spent
            if cycle >= cycles - last:
                time, work = time + spent, work + done
        if not stalled[k]:
            rates[i] = rate
            told[k, 0], told[k, 1], told[k, 2] = 60.0 * last / time, work / (2.0 * math.pi * last), work / time


@njit(cache=True, nogil=True)
def round_speeds(speeds):
    """Put ``speeds`` (k, cycles) on the grid of shares: a cycle that has a speed of before has its model."""
    for k in range(speeds.shape[0]):
        for cycle in range(speeds.shape[1]):
            speeds[k, cycle] = math.exp(np.rint(math.log(speeds[k, cycle]) / GRID) * GRID)
