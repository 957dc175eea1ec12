"""A machine that moves on in time, by steps of any length, with inputs that change between them.

``simulate`` runs whole cycles. Other programs step in time: there, each cycle is simulated when it begins, at the
inputs of that moment, and read at the instant that was reached.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.numbers import number
from chaosgym.series.two_step import two_step_test
from chaosgym.simulation.record import CycleRecord, joined
from chaosgym.simulation.run import begin_state, simulate

ROUNDING = 1e-6
"""Share of a cycle by which an instant may miss the end of the cycle, or a sample of it, and still is there."""

LONGEST = 400
"""Cycles that the verdict is about at most, the last ones at these inputs."""

NATURES = ("undetermined", "periodic", "quasiperiodic", "chaotic")


class MotionInTime:
    """A machine that moves on in time.

    Parameters
    ----------
    machine
        What runs, from the state that it begins from.
    samples
        Instants of each cycle at which its motion is known. Between two of them it stays as at the first.

    Attributes
    ----------
    inputs
        Values of the machine's ``operating_fields``; new ones take effect when the next cycle begins.
    cycles
        Cycles that are over.
    peaks, impacts : (sides,)
        Largest force of the last of them on each side [N], and contacts that began in it; 0 before there is one.

    Examples
    --------
    >>> from chaosgym.simulation.motion_in_time import MotionInTime
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=20.0)
    >>> motion = MotionInTime(beam, 8)
    >>> for _ in range(16):
    ...     motion.advance(1.0 / 160.0)
    >>> motion.cycles, bool(motion.peaks.max() == chaosgym.simulate(beam, 2).peak_force[1].max())
    (2, True)
    """

    def __init__(self, machine: Machine, samples: int) -> None:
        self._machine, self._samples = machine, samples
        self.inputs: dict[str, float] = {name: float(getattr(machine, name)) for name in machine.operating_fields}
        self.cycles = 0
        self.peaks, self.impacts = np.zeros(len(machine.sides)), np.zeros(len(machine.sides), np.int64)
        self._elapsed = 0.0
        self._state = begin_state(machine)
        self._records: list[CycleRecord] = []
        self._verdict: Mapping[str, Any] | None = None
        self._ran_at: dict[str, float] = {}
        self._begin()

    @property
    def period(self) -> float:
        """Duration of the cycle that runs [s]."""
        return self._now.machine.cycle_period

    @property
    def speed(self) -> float:
        """That of the cycle that runs, in the unit of the machine's speed field."""
        return float(getattr(self._now.machine, self._machine.speed_field))

    def advance(self, step: float) -> None:
        """Move on by a time [s].

        Raises
        ------
        ParameterError
            If the step is negative or not finite, or an input out of range.
        SimulationError
            If a cycle can't be simulated.
        """
        number("step", step, 0.0, unit="s")
        if self._elapsed == 0.0 and self._ran_at != self.inputs:
            self._begin()
        self._elapsed += step
        while self._elapsed >= self.period * (1.0 - ROUNDING):
            self._elapsed = max(self._elapsed - self.period, 0.0)
            self._end()
        if self._elapsed < ROUNDING * self.period:
            self._elapsed = 0.0

    @property
    def motion(self) -> Array:
        """Displacement [m], velocity [m/s] and force [N] of each joint at the last sample so far, (joints, 3)."""
        every = self._now.history if self._now.histories is None else self._now.histories
        assert every is not None
        place = int(self._elapsed / self.period * self._samples + ROUNDING * self._samples)
        return np.asarray(every[0, min(place, self._samples - 1)].reshape(-1, 3))

    @property
    def verdict(self) -> Mapping[str, Any]:
        """``nature``, ``period`` in cycles, None if it does not repeat, and ``margin`` of the two-step test.

        It is about the whole cycles at the present inputs, the last ``LONGEST`` of them.
        """
        if self._verdict is None:
            try:
                if not self._records:
                    raise DiagnosisError("no cycle is over")
                told = two_step_test(joined(self._records))
                self._verdict = {"nature": told.nature, "period": told.period, "margin": told.margin}
            except DiagnosisError:  # too few cycles yet
                self._verdict = {"nature": NATURES[0], "period": None, "margin": 0.0}
        return self._verdict

    def _begin(self) -> None:
        """Simulate the cycle that begins, at the present inputs."""
        if self._ran_at != self.inputs:
            self._machine = with_settings(self._machine, self.inputs)
        self._ran_at = dict(self.inputs)
        self._now = simulate(self._machine, 1, self._state, samples_per_cycle=self._samples)

    def _end(self) -> None:
        """Count the cycle that runs as over, and begin the next one."""
        if self._records and self._records[-1].machine is not self._now.machine:
            self._records.clear()
        self._records = [*self._records[1 - LONGEST :], self._now]
        self._verdict = None
        self._state = self._now.final_state
        self.peaks, self.impacts = self._now.peak_force[0], self._now.impacts[0]
        self.cycles += 1
        self._begin()
