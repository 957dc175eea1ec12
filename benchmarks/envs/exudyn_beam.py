"""The beam of an environment in Exudyn, cycle by cycle, with a trajectory beside it that tells chaos.

Equations and modes are ours, so that both integrate the same machine (``benchmarks.performance.exudyn_machines``).
Motion, contact, peaks, impacts, bouncing and the exponent come from Exudyn's steps alone.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.performance.exudyn_machines import ExudynSetting, add_beam, load_exudyn, settings_of
from chaosgym.machines.impact_beam import ImpactBeam

Array = NDArray[np.float64]

SETTING = ExudynSetting("RK44", "law", 1e-5)
"""In such steps the nominal beam is regular or not as in exact events at 16 of 18 speeds, in half of them at 18."""

BESIDE = 1e-6
"""Distance of the trajectory beside, as a share of the state, in the norm of the energy."""


class Ran(NamedTuple):
    """Cycles of one beam: peak forces [N], ``impacts`` and ``bouncing`` [s] by surface (cycles, 2), ``growth``."""

    peaks: Array
    impacts: Array
    bouncing: Array
    growth: Array


class ExudynBeam:
    """An impact beam at rest.

    Parameters
    ----------
    beam
        At any frequency.

    Raises
    ------
    ChaosgymError
        If Exudyn is not installed.
    """

    def __init__(self, beam: ImpactBeam) -> None:
        self._exudyn = load_exudyn()
        container = self._exudyn.SystemContainer()
        self._container, self._system = container, container.AddSystem()
        self._parts = add_beam(self._exudyn, self._system, beam, SETTING)
        kinds, items = self._exudyn.OutputVariableType, self._exudyn.itemInterface
        self._sensors = [
            self._system.AddSensor(
                items.SensorNode(nodeNumber=self._parts.node, storeInternal=True, outputVariableType=kind)
            )
            for kind in (kinds.Coordinates, kinds.Coordinates_t)
        ]
        self._system.Assemble()
        self._gap, self._law = beam.clearance, (beam.contact_stiffness, beam.contact_damping)
        n = len(self._parts.mass)
        self._state, self._beside = np.zeros((2, n)), np.cos(1.0 + np.arange(2.0 * n)).reshape(2, n)
        self._side, self._first, self._last = 0, 0.0, 0.0
        self._pressed = np.zeros(2, np.bool_)

    def run(self, frequencies: Array, gap: float) -> Ran:
        """Run a cycle at each of the frequencies (cycles,) [Hz], with a gap [m] on either side."""
        self._gap = gap
        self._system.SetObjectParameter(self._parts.stops, "offset", gap)
        return Ran(*(np.array(values) for values in zip(*map(self._cycle, frequencies.tolist()), strict=True)))

    def _cycle(self, frequency: float) -> tuple[Array, Array, Array, float]:
        size = max(self._norm(self._state), 1e-12) * BESIDE
        there, _ = self._moved(self._state + self._beside * (size / self._norm(self._beside)), frequency)
        self._state, tip = self._moved(self._state, frequency)
        self._beside = there - self._state
        growth = float(np.log(max(self._norm(self._beside), 1e-300) / size))
        return *self._felt(tip, frequency), growth

    def _norm(self, state: Array) -> float:
        """Square root of twice the energy of displacement and velocity, (2, n)."""
        (q, v), parts = state, self._parts
        return float(np.sqrt(q @ parts.stiffness @ q + v @ parts.mass @ v))

    def _moved(self, state: Array, frequency: float) -> tuple[Array, Array]:
        """State after a cycle, and the tip's instant, displacement and velocity after each step, (3, steps)."""
        system, data = self._system, self._system.systemData
        steps = int(np.ceil(1.0 / (frequency * SETTING.step)))
        settings = settings_of(self._exudyn, 1.0 / frequency, 1, steps, SETTING)
        initial = self._exudyn.ConfigurationType.Initial
        data.SetODE2Coordinates(state[0], initial)
        data.SetODE2Coordinates_t(state[1], initial)
        system.SetLoadParameter(self._parts.load, "load", 2.0 * np.pi * frequency)
        system.SolveDynamic(settings, solverType=getattr(self._exudyn.DynamicSolverType, SETTING.solver))
        x, v = (system.GetSensorStoredData(sensor)[-steps:] for sensor in self._sensors)
        return np.array([data.GetODE2Coordinates(), data.GetODE2Coordinates_t()]), np.array([x[:, 0], x[:, 1], v[:, 1]])

    def _felt(self, tip: Array, frequency: float) -> tuple[Array, Array, Array]:
        """Peaks, impacts and bouncing of a cycle by surface, (2,) each: the upper one first."""
        instant, x, v = tip
        depth, rate = np.array([x, -x]) - self._gap, np.array([v, -v])
        force = np.where(depth > 0.0, np.maximum(self._law[0] * depth + self._law[1] * rate, 0.0), 0.0)
        presses = np.column_stack([self._pressed, force > 0.0])
        touched = np.diff(presses.astype(int), axis=1) > 0
        self._pressed = presses[:, -1]
        bouncing = np.zeros(2)
        for side, time in sorted(((side, instant[step]) for side, step in np.argwhere(touched)), key=lambda at: at[1]):
            if self._side != side + 1:
                if self._side:
                    bouncing[self._side - 1] = max(bouncing[self._side - 1], self._last - self._first)
                self._side, self._first = side + 1, time
            self._last = time
        self._first, self._last = self._first - 1.0 / frequency, self._last - 1.0 / frequency
        return force.max(axis=1), touched.sum(axis=1), bouncing
