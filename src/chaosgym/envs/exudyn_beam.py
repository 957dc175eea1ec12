"""Impact beams in Exudyn, cycle by cycle, with a trajectory beside each that tells chaos.

Equations and modes are ours: the body has the mass, stiffness and damping matrices of our modes, turned into
coordinates of which the first is the tip and the second the point of the force (``ObjectGenericODE2``). Motion,
contact, peaks, impacts, bouncing and growth come from Exudyn's steps alone.

Sources: exudyn.readthedocs.io, reference manual of the items used; Exudyn is written by J. Gerstmayr.
"""

import contextlib
import io
import sys
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from chaosgym.arrays import Array, Indices
from chaosgym.core import status
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.modal_model import ModalImpactModel
from chaosgym.errors import ChaosgymError, ParameterError
from chaosgym.machines import ImpactBeam
from chaosgym.machines.batch import VaryingBatch
from chaosgym.machines.machine import Machine

SOLVER, STEP = "RK44", 1e-5
"""In such steps [s] the nominal beam is regular or not as in exact events at 16 of 18 speeds, in half of them at 18."""

BESIDE = 1e-6
"""Distance of the trajectory beside, as a share of the state, in the norm of the energy."""

COARSE = 1.0
"""Largest product of step and fastest rate: the fourth-order method is stable up to 2.8."""


def load_exudyn() -> Any:
    """Import Exudyn, the build without range checks where there is one.

    Raises
    ------
    ChaosgymError
        If it is not installed.
    """
    vars(sys).setdefault("exudynFast", True)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            import exudyn
            import exudyn.itemInterface
            import exudyn.utilities
    except ImportError as error:
        raise ChaosgymError("exudyn is not installed; install it with: pip install exudyn") from error
    return exudyn


def settings_of(exudyn: Any, period: float, cycles: int, steps: int) -> Any:
    """Exudyn's settings of a run of some cycles of a period [s] in equal ``steps`` each."""
    settings = exudyn.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime = period * cycles
    integration.numberOfSteps = steps * cycles
    integration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = period / steps
    settings.linearSolver.solverType = exudyn.LinearSolverType.EXUdense
    settings.parallel.numberOfThreads = 1
    return settings


def add_stops(exudyn: Any, system: Any, marker: int, gap: float, stiffness: float, damping: float) -> Any:
    """Put two surfaces of our contact law around the coordinate of a marker; return the connector."""
    items, symbolic = exudyn.itemInterface, exudyn.symbolic
    fixed = system.AddNode(items.NodePointGround())
    ground = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))

    def force(mbs: Any, t: Any, item: Any, x: Any, v: Any, k: Any, d: Any, c: Any) -> Any:
        upper = symbolic.max(0.0, k * (x - c) + d * v) * (0.5 * symbolic.sign(x - c) + 0.5)
        lower = symbolic.max(0.0, k * (-x - c) - d * v) * (0.5 * symbolic.sign(-x - c) + 0.5)
        return upper - lower

    spring = system.AddObject(
        items.ObjectConnectorCoordinateSpringDamper(
            markerNumbers=[ground, marker], stiffness=stiffness, damping=damping, offset=gap
        )
    )
    name = "springForceUserFunction"
    compiled = exudyn.utilities.CreateSymbolicUserFunction(system, force, name, spring)
    system.SetObjectParameter(spring, name, compiled)
    return spring


class BeamItems(NamedTuple):
    """Numbers of the parts of a beam: its ``node``, whose coordinate 0 is the tip, the marker of that ``tip``, and the
    ``load``, whose parameter is the angular frequency; mass and stiffness matrices (n, n) of the node's coordinates."""

    node: Any
    tip: Any
    load: Any
    mass: Array
    stiffness: Array


def add_beam(exudyn: Any, system: Any, beam: ImpactBeam) -> BeamItems:
    """Add an impact beam without its stops."""
    items, model = exudyn.itemInterface, beam.reduce()
    assert isinstance(model, ModalImpactModel)
    shapes = np.vstack([model.tip_shape, beam.structure.drive[0, 0, 1]])
    modal = np.linalg.inv(np.vstack([shapes, scipy.linalg.null_space(shapes).T]))
    n = len(modal)
    mass, stiffness = modal.T @ modal, modal.T @ (model.stiffness[:, None] * modal)
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * n,
            initialCoordinates=[0.0] * n,
            initialCoordinates_t=[0.0] * n,
            numberOfODE2Coordinates=n,
        )
    )
    system.AddObject(
        items.ObjectGenericODE2(
            nodeNumbers=[node],
            massMatrix=mass,
            stiffnessMatrix=stiffness,
            dampingMatrix=modal.T @ model.damping @ modal,
        )
    )
    tip, shaker = (system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=i)) for i in (0, 1))
    omega, amplitude = 2.0 * np.pi * model.excitation_frequency, beam.force_amplitude
    load = system.AddLoad(items.LoadCoordinate(markerNumber=shaker, load=omega))
    drive = exudyn.utilities.CreateSymbolicUserFunction(
        system, lambda mbs, t, omega: amplitude * exudyn.symbolic.sin(omega * t), "loadUserFunction", load
    )
    system.SetLoadParameter(load, "loadUserFunction", drive)
    return BeamItems(node, tip, load, mass, stiffness)


class ExudynBeam:
    """An impact beam at rest in Exudyn.

    Raises
    ------
    ParameterError
        If it is too stiff for the steps, or its tip and its shaker are one.
    """

    def __init__(self, beam: ImpactBeam) -> None:
        if beam.n_states < 4 or beam.force_position == beam.length:
            raise ParameterError(
                "Exudyn's beam has tip and shaker apart; allowed: n_modes + fitted_modes of 2 or more, and a "
                "force_position below the length"
            )
        if beam.fastest_rate * STEP > COARSE:
            raise ParameterError(
                f"the beam is too stiff for Exudyn's steps of {STEP:g} s: its fastest rate is {beam.fastest_rate:.3g} "
                f"1/s; allowed: up to {COARSE / STEP:g}, by less contact_stiffness, contact_damping or n_modes"
            )
        self._exudyn = load_exudyn()
        container = self._exudyn.SystemContainer()
        self._container, self._system = container, container.AddSystem()
        self._parts = add_beam(self._exudyn, self._system, beam)
        law = (beam.contact_stiffness, beam.contact_damping)
        self._stops = add_stops(self._exudyn, self._system, self._parts.tip, beam.clearance, *law)
        kinds, items = self._exudyn.OutputVariableType, self._exudyn.itemInterface
        self._sensors = [
            self._system.AddSensor(
                items.SensorNode(nodeNumber=self._parts.node, storeInternal=True, outputVariableType=kind)
            )
            for kind in (kinds.Coordinates, kinds.Coordinates_t)
        ]
        self._system.Assemble()
        self._gap, self._law = beam.clearance, law
        n = len(self._parts.mass)
        self._state, self._beside = np.zeros((2, n)), np.cos(1.0 + np.arange(2.0 * n)).reshape(2, n)
        self._side, self._first, self._last = 0, 0.0, 0.0
        self._pressed = np.zeros(2, np.bool_)

    def set_gap(self, gap: float) -> None:
        """Change the gap [m] on either side."""
        self._gap = gap
        self._system.SetObjectParameter(self._stops, "offset", gap)

    def cycle(self, frequency: float) -> tuple[Array, Array, Array, float]:
        """Run a cycle at a frequency [Hz]: peaks [N], impacts and bouncing [s] by surface, (2,) each, and growth."""
        size = max(self._norm(self._state), 1e-12) * BESIDE
        there, _ = self._moved(self._state + self._beside * (size / self._norm(self._beside)), frequency)
        self._state, tip = self._moved(self._state, frequency)
        beside = there - self._state
        grown = self._norm(beside)
        if grown > 0.0:  # else it is lost in rounding, beside a motion that grew from rest by many orders
            self._beside = beside
        growth = float(np.log(max(grown, 1e-300) / size))
        return *self._felt(tip, frequency), growth

    def _norm(self, state: Array) -> float:
        """Square root of twice the energy of displacement and velocity, (2, n)."""
        (q, v), parts = state, self._parts
        return float(np.sqrt(q @ parts.stiffness @ q + v @ parts.mass @ v))

    def _moved(self, state: Array, frequency: float) -> tuple[Array, Array]:
        """State after a cycle, and the tip's instant, displacement and velocity after each step, (3, steps)."""
        system, data = self._system, self._system.systemData
        steps = int(np.ceil(1.0 / (frequency * STEP)))
        settings = settings_of(self._exudyn, 1.0 / frequency, 1, steps)
        initial = self._exudyn.ConfigurationType.Initial
        data.SetODE2Coordinates(state[0], initial)
        data.SetODE2Coordinates_t(state[1], initial)
        system.SetLoadParameter(self._parts.load, "load", 2.0 * np.pi * frequency)
        system.SolveDynamic(settings, solverType=getattr(self._exudyn.DynamicSolverType, SOLVER))
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


class ExudynBatch(VaryingBatch):
    """Impact beams in Exudyn, which move one after another; they are not kicked, and their motion is not told.

    Raises
    ------
    ChaosgymError
        If Exudyn is not installed.
    """

    def __init__(self, machine: Machine, count: int) -> None:
        load_exudyn()
        super().__init__(machine, count)
        self._beams: dict[int, ExudynBeam] = {}
        self._speeds = np.zeros(count)

    def change(self, i: int, machine: Any) -> None:
        """Put another machine, at rest, into place i."""
        self._beams[i], self._speeds[i] = ExudynBeam(machine), machine.excitation_frequency

    def kick(self, which: Indices, shares: Array) -> None:
        """Refuse: no velocities are kicked there."""
        raise ParameterError("kick is out of range; allowed: 0 in Exudyn")

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the excitation frequencies [Hz]."""
        self._speeds[which] = speeds

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self._beams[i].set_gap(clearance)

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        speeds = self._speeds[which][:, None].repeat(arrays.peak_force.shape[1], axis=1)
        self._vary(which, speeds, self._deviations, np.empty((*speeds.shape, 1)), arrays, outcome)

    def _vary(
        self, which: Indices, speeds: Array, vectors: Array, growth: Array, arrays: CycleArrays, outcome: Indices
    ) -> None:
        written = (arrays.peak_force, arrays.impacts, arrays.bounce_time, growth[:, :, 0])
        for k, i in enumerate(which.tolist()):
            for cycle, speed in enumerate(speeds[k].tolist()):
                for array, value in zip(written, self._beams[i].cycle(speed), strict=True):
                    array[k, cycle] = value
            outcome[k] = status.OK if np.isfinite(arrays.peak_force[k]).all() else status.DIVERGED
