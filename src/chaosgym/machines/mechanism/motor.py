r"""Crank of a mechanism under a motor: run-up, mean speed and its swing, stall.

Every gap stays in its middle, so that the crank alone moves, by

    d/dtheta (J + I) w^2 / 2 = T_m(w) - T_0 - T_1 w

with the rotor and flywheel J, the inertia I(theta) of all links as the crank feels it, the motor's curve T_m from its
torque at rest to none at its speed without load, and what weight, gas and springs (T_0) and dampers (T_1) take at each
angle.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import needed
from chaosgym.numbers import number, numbers, whole

if TYPE_CHECKING:
    from chaosgym.core.motor import Crank


MOST_CYCLES = 20_000
"""Cycles after which a speed that still changes is taken as it is."""

SETTLED = 1e-5
"""Share of the mean speed by which it may still change, as its last changes go on in a geometric series."""

WIDE = 0.05
"""Swing of the speed beyond which forces at a constant speed are off by more than 10 %."""

ABOVE = 1e-3
"""Share by which the speed of runs may exceed the settled one and be taken for it."""

LONGEST, FASTEST = 10**6, 1e5
"""Most cycles, and highest speed [rpm] at the beginning."""

NEARLY = 0.99
"""Share of the settled speed that ends a run-up."""

LEAST = 1e-9
"""Least inertia in a revolution, as a share of the largest."""


MOTOR_FIELDS: Mapping[str, dict[str, Any]] = {
    "motor_stall_torque": {"unit": "N m", "low": 1e-9, "high": 1e9},
    "motor_no_load_speed": {"unit": "rpm", "low": 0.1, "high": 1e5},
    "motor_inertia": {"unit": "kg m^2", "low": 0.0, "high": 1e9},
}
"""Fields of the motor: its torque at rest, its speed without load, rotor and flywheel at the crank."""


LINE = ((0.0, 1.0), (1.0, 0.0))
"""Speeds and torques of a straight line, as shares of the speed without load and of the torque at rest."""


class Motor(NamedTuple):
    """A motor with a curve of torque over speed, and what turns with it.

    ``stall_torque`` [N m] at rest, ``no_load_rate`` [rad/s] at which it gives none, ``inertia`` [kg m^2] of rotor and
    flywheel at the crank; ``curve``, speeds and torques as shares of the first two.
    """

    stall_torque: float
    no_load_rate: float
    inertia: float
    curve: tuple[tuple[float, ...], tuple[float, ...]] = LINE


def motor_of(table: Mapping[str, Any]) -> Motor:
    """Motor of the table of a file, its speed in rpm.

    Raises
    ------
    ParameterError
        If a key is missing or does not go with the others, or a curve does not go from rest to no torque.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.motor import motor_of
    >>> motor_of({"speeds": [0.0, 800.0, 1000.0], "torques": [20.0, 30.0, 0.0]}).curve
    ((0.0, 0.8, 1.0), (1.0, 1.5, 0.0))
    """
    inertia = table.get("inertia", 0.0)
    if not {"speeds", "torques"} & set(table):
        stall, speed = needed("motor", table, "stall_torque", "no_load_speed")
        return Motor(stall, speed, inertia)
    for key in ("stall_torque", "no_load_speed"):
        if key in table:
            raise ParameterError(f"motor.{key} has no meaning beside motor.speeds and torques; leave it out")
    rows = needed("motor", table, "speeds", "torques")
    speeds, torques = numbers("motor.speeds", rows[0], 0.0, FASTEST, "rpm"), numbers("motor.torques", rows[1], 0.0, 1e9)
    if len(speeds) != len(torques):
        raise ParameterError(
            f"motor.speeds has {len(speeds)} numbers and motor.torques {len(torques)}; allowed: as many"
        )
    if len(speeds) < 2 or speeds[0] != 0.0 or np.any(np.diff(speeds) <= 0.0):
        raise ParameterError("motor.speeds is out of range; allowed: two or more numbers that grow from 0 rpm on")
    if torques[-1] != 0.0 or not np.all(torques[:-1] > 0.0):
        raise ParameterError("motor.torques is out of range; allowed: above 0 N m, and 0 N m at the last speed")
    curve = tuple((speeds / speeds[-1]).tolist()), tuple((torques / torques[0]).tolist())
    return Motor(float(torques[0]), float(speeds[-1]), inertia, curve)


class Load(NamedTuple):
    """What a motor turns at B equal steps of a revolution, from crank angle 0 on.

    ``inertia`` (B,) [kg m^2] of the links at the crank; torque that resists: ``still`` (B,) [N m] whatever the speed,
    ``viscous`` (B,) [N m s] in proportion to it.
    """

    inertia: Array
    still: Array
    viscous: Array


class MotorRun(NamedTuple):
    """Cycles of a crank under its motor.

    Attributes
    ----------
    speed, lowest, highest : (cycles,)
        Mean speed of each whole cycle, and its ends [rpm].
    power : (cycles,)
        Mean power of the motor [W].
    stalled
        Crank angle [deg] at which the crank stopped in the cycle after the last one; None if it went on.
    settled
        Whether the mean speed of the last cycle is that of all to come, to 0.001 %.
    """

    speed: Array
    lowest: Array
    highest: Array
    power: Array
    stalled: float | None
    settled: bool

    @property
    def operation(self) -> dict[str, Array]:
        """Speeds for ``simulate``, to 0.1 %: a cycle that has a speed of before has its model."""
        from chaosgym.core.compilation import call
        from chaosgym.core.motor import round_speeds

        speeds = self.speed[None].copy()
        call(round_speeds, speeds)
        return {"speed": speeds[0]}

    @property
    def swing(self) -> float:
        """Highest less lowest speed of the last cycle, as a share of its mean; nan without a whole cycle."""
        if not len(self.speed):
            return float("nan")
        return float((self.highest[-1] - self.lowest[-1]) / self.speed[-1])

    @property
    def settled_power(self) -> float:
        """Mean power [W] of the last cycle; 0 where it is less than what a settled speed may still change."""
        # torque at rest times speed without load is four times the most power of a straight line
        last = float(self.power[-1])
        return last if abs(last) > 4.0 * SETTLED * np.abs(self.power).max() else 0.0

    @property
    def run_up_time(self) -> float:
        """Time [s] until a cycle has 99 % of the last one's mean speed; nan without a whole cycle."""
        if not len(self.speed):
            return float("nan")
        turns = int(np.argmax(self.speed >= NEARLY * self.speed[-1])) + 1
        return 60.0 * float(np.sum(1.0 / self.speed[:turns]))

    def as_dict(self) -> dict[str, float | None]:
        """Plain values for JSON, with their units; None for what a crank that stalls or does not settle has not."""
        found = (
            {
                "speed_rpm": float(self.speed[-1]),
                "swing": self.swing,
                "power_W": self.settled_power,
                "run_up_s": self.run_up_time,
            }
            if self.settled
            else dict.fromkeys(("speed_rpm", "swing", "power_W", "run_up_s"))
        )
        return {**found, "stalled_deg": self.stalled, "turns": len(self.speed)}

    def notes(self, speed: float, no_load_speed: float) -> list[str]:
        """A line for people if a motor from rest does not take the crank to the speed [rpm] of runs."""
        if speed > no_load_speed:
            return [f"runs are at {speed:g} rpm; the motor has {no_load_speed:g} rpm without load"]
        if self.settled and speed > (1.0 + ABOVE) * self.speed[-1]:
            return [f"runs are at {speed:g} rpm; under its load the motor settles at {self.speed[-1]:.4g} rpm"]
        return []

    @property
    def told(self) -> str:
        """A line for people, of a run from rest until it is settled."""
        if self.stalled is not None:
            return f"motor: from rest the crank stops at {self.stalled:.0f} deg after {len(self.speed)} whole turns"
        if not self.settled:
            return f"motor: not settled after {len(self.speed):,} turns from rest, then at {self.speed[-1]:.4g} rpm"
        wide = f"; beyond {WIDE:.0%}, so that runs at a constant speed are far from it" if self.swing > WIDE else ""
        return (
            f"motor: settles at {self.speed[-1]:.4g} rpm, which swings by {100.0 * self.swing:.2g} % in a cycle; gives "
            f"{self.settled_power:.4g} W; from rest to {NEARLY:.0%} of that speed in {self.run_up_time:.2g} s{wide}"
        )


def crank_of(motor: Motor, load: Load) -> "Crank":
    """What turns, ready to be stepped.

    Raises
    ------
    ParameterError
        If nothing that turns has inertia, or the motor's curve is so steep that the speed follows it within a step.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.motor import Load, Motor, crank_of
    >>> free = Load(np.zeros(90), np.zeros(90), np.zeros(90))
    >>> crank_of(Motor(10.0, 100.0, 0.1), free).torques  # N m
    array([10.,  0.])
    """
    from chaosgym.core.motor import Crank

    width = 2.0 * math.pi / len(load.still)
    rates, torques = np.multiply(motor.no_load_rate, motor.curve[0]), np.multiply(motor.stall_torque, motor.curve[1])
    slope = float(np.max(-np.diff(torques) / np.diff(rates)))
    inertia = motor.inertia + load.inertia
    still = inertia <= LEAST * inertia.max()
    if still.any():
        where = math.degrees(int(still.argmax()) * width)
        raise ParameterError(
            f"nothing that turns has inertia at crank angle {where:.0f} deg; allowed: [motor] inertia above 0"
        )
    if 0.5 * width * slope > inertia.min() * motor.no_load_rate:
        least = 0.5 * width * slope / motor.no_load_rate - load.inertia.min()
        raise ParameterError(
            f"the motor's curve is so steep that the speed follows it within {math.degrees(width):g} deg; "
            f"allowed: [motor] inertia from {least:.2g} kg m^2 on"
        )
    return Crank(inertia, load.still, load.viscous, torques, rates)


def turn(motor: Motor, load: Load, rate: float = 0.0, cycles: int | None = None) -> MotorRun:
    """Turn a crank from angle 0 on.

    Parameters
    ----------
    motor, load
        What turns, and what is turned.
    rate
        Of the crank at the beginning [rad/s].
    cycles
        How many, or until the mean speed has settled.

    Raises
    ------
    ParameterError
        If cycles or rate are out of range, or as ``crank_of``.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.motor import Load, Motor, turn
    >>> free = Load(np.zeros(90), np.zeros(90), np.zeros(90))
    >>> round(float(turn(Motor(10.0, 100.0, 0.1), free).speed[-1] * np.pi / 30.0), 2)
    100.0
    """
    from chaosgym.core.compilation import call
    from chaosgym.core.motor import TURNS, revolution

    if cycles is not None:
        cycles = whole("cycles", cycles, 1, LONGEST)
    rate = number("speed", rate * 30.0 / math.pi, 0.0, FASTEST, "rpm") * math.pi / 30.0
    crank = crank_of(motor, load)
    speeds: list[tuple[float, float, float, float]] = []
    while len(speeds) < (MOST_CYCLES if cycles is None else cycles):
        stopped, rate, time, work, low, high = call(revolution, *crank, motor.no_load_rate, rate)
        if stopped != TURNS:
            return _run(speeds, 360.0 * stopped / len(load.still), False)
        speeds.append((2.0 * math.pi / time, low, high, work / time))
        if cycles is None and _settled([each[0] for each in speeds[-3:]]):
            break
    return _run(speeds, None, _settled([each[0] for each in speeds[-3:]]))


def _settled(last: list[float]) -> bool:
    """Whether the last three mean speeds say that they hardly go on changing."""
    if len(last) < 3:
        return False
    before, after = abs(last[1] - last[0]), abs(last[2] - last[1])
    bound = SETTLED * last[2]
    return after <= 1e-9 * last[2] or (after < before and after**2 / (before - after) < bound)


def _run(cycles: list[tuple[float, float, float, float]], stalled: float | None, settled: bool) -> MotorRun:
    mean, low, high, power = np.array(cycles).reshape(-1, 4).T
    rpm = 30.0 / math.pi
    return MotorRun(rpm * mean, rpm * low, rpm * high, power, stalled, settled)
