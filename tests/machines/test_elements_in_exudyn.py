"""Elements of machines' files against Exudyn, a program that shares no equation with ours: `pip install exudyn`.

Bodies, connectors and loads are Exudyn's own. Those of gap files are moved by Runge-Kutta steps of 0.1 us of order
four: what is left are the instants of contact, which fall between two steps.
"""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from benchmarks.performance.exudyn_machines import ExudynSetting, add_pin, solver_settings
from chaosgym.envs.exudyn_beam import load_exudyn, settings_of
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.machines.parameters import with_settings
from tests.machines.test_elements import ARCMIN, GEARED, HERTZIAN, SOFT_THEN_HARD, in_bodies, read

pytestmark = pytest.mark.slow

STEP = 1e-7
"""Time step [s]."""


class Parts:
    """Bodies in Exudyn that move along one coordinate each, and what acts on them.

    Parameters
    ----------
    inertias
        Mass [kg] or moment of inertia [kg m^2] of each body, which begins at rest at zero.
    """

    def __init__(self, *inertias):
        self.exudyn = load_exudyn()
        self.items, self.symbolic = self.exudyn.itemInterface, self.exudyn.symbolic
        self.container = self.exudyn.SystemContainer()
        self.system = self.container.AddSystem()
        self.nodes = [self.system.AddNode(self.items.Node1D(referenceCoordinates=[0.0])) for _ in inertias]
        for node, inertia in zip(self.nodes, inertias, strict=True):
            self.system.AddObject(self.items.ObjectMass1D(mass=inertia, nodeNumber=node))
        ground = self.system.AddNode(self.items.NodePointGround())
        self.ground, *self.bodies = (
            self.system.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
            for node in (ground, *self.nodes)
        )

    def spring(self, body, stiffness, damping):
        """Put a spring and a damper between a body and the ground."""
        self.system.AddObject(
            self.items.ObjectConnectorCoordinateSpringDamper(
                markerNumbers=[self.ground, self.bodies[body]], stiffness=stiffness, damping=damping
            )
        )

    def pull(self, body, amplitude, frequency):
        """Pull a body by a sine [Hz], or by a constant where the frequency is zero."""
        marker, symbolic = self.bodies[body], self.symbolic
        load = self.system.AddLoad(self.items.LoadCoordinate(markerNumber=marker, load=amplitude))
        if frequency:
            omega = 2.0 * math.pi * frequency
            self._use(load, "loadUserFunction", lambda mbs, t, load: load * symbolic.sin(omega * t))

    def spring_over_time(self, body, stiffness):
        """Put a spring between a body and the ground whose stiffness is a function of the time."""
        connector = self.system.AddObject(
            self.items.ObjectConnectorCoordinateSpringDamper(markerNumbers=[self.ground, self.bodies[body]])
        )
        self._use(connector, "springForceUserFunction", lambda mbs, t, item, x, v, k, d, offset: stiffness(t) * x)

    def stop(self, law, body, factor=1.0, other=None, other_factor=1.0):
        """Let ``law(x, v)`` pull at x = factor times a body's coordinate less other_factor times another's."""
        markers = [self.ground if other is None else self.bodies[other], self.bodies[body]]
        connector = self.system.AddObject(
            self.items.ObjectConnectorCoordinateSpringDamperExt(
                markerNumbers=markers, factor0=other_factor, factor1=factor
            )
        )

        def force(mbs, t, item, x, v, k, d, offset, speed, dynamic, static, decay, viscous, zone):
            return law(x, v)

        self._use(connector, "springForceUserFunction", force)

    def pressed(self, depth, force):
        """A force that only pushes, and only where the depth is positive."""
        return self.symbolic.max(0.0, force) * (0.5 * self.symbolic.sign(depth) + 0.5)

    def _use(self, item, name, function):
        compiled = self.exudyn.utilities.CreateSymbolicUserFunction(self.system, function, name, item)
        put = self.system.SetLoadParameter if name.startswith("load") else self.system.SetObjectParameter
        put(item, name, compiled)

    def after(self, seconds):
        """Coordinates of the bodies after a time [s]."""
        kind = self.exudyn.OutputVariableType.Coordinates
        sensors = [
            self.system.AddSensor(self.items.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind))
            for node in self.nodes
        ]
        self.system.Assemble()
        settings = settings_of(self.exudyn, seconds, 1, math.ceil(seconds / STEP))
        settings.solution.sensors.writePeriod = seconds
        self.system.SolveDynamic(settings, solverType=self.exudyn.DynamicSolverType.RK44)
        return np.array([self.system.GetSensorStoredData(sensor)[-1, 1] for sensor in sensors])


def differs(machine, points, parts):
    """Largest difference of the points after a cycle from rest, ours less Exudyn's."""
    record = chaosgym.simulate(machine, 2, integrator=TIGHTEST_EVENTS)
    assert record.impacts[0].sum() > 0
    own = in_bodies(machine, points, record.section)[1, : len(points)]
    return np.abs(own - parts.after(machine.cycle_period)).max()


@pytest.fixture(autouse=True)
def exudyn():
    """Exudyn, where it is installed."""
    return pytest.importorskip("exudyn")


def test_a_gear_pair_with_backlash_drag_and_a_spring(tmp_path):
    """Exudyn's connector with a factor of 3 at one end moves both wheels alike, to 1e-6 of the backlash."""
    gap = 10.0 * ARCMIN
    parts = Parts(0.8e-4, 30e-4)
    parts.spring(1, 25.0, 0.01)
    parts.pull(0, 0.5, 7.0)
    parts.pull(1, -0.4, 0.0)

    def teeth(x, v):
        ahead, behind = 400.0 * (x - gap) + 0.02 * v, 400.0 * (-x - gap) - 0.02 * v
        return parts.pressed(x - gap, ahead) - parts.pressed(-x - gap, behind)

    parts.stop(teeth, body=0, other=1, other_factor=3.0)
    assert differs(read(tmp_path, GEARED), ("motor", "wheel"), parts) < 1e-6 * gap


def test_rubber_and_steel_at_one_point(tmp_path):
    """A mass under its weight between rubber, steel behind it and a third stop: to 1e-5 of the gap.

    The dampers' forces jump within a step of Exudyn, so that its error falls with the step alone.
    """
    machine = read(tmp_path, SOFT_THEN_HARD)
    parts, rate = Parts(2.0), 2.0 * math.pi * 5.0
    parts.spring(0, 2.0 * rate**2, 2.0 * 2.0 * 0.01 * rate)
    parts.pull(0, 20.0, 6.5)
    parts.pull(0, -19.6133, 0.0)
    for side, gap, stiffness, damping in (
        (1.0, 1e-3, 2e4, 15.0),
        (1.0, 1.5e-3, 2e6, machine.steel_damping),
        (-1.0, 1e-3, 1e5, 0.0),
    ):

        def stop(x, v, gap=gap, stiffness=stiffness, damping=damping):
            return parts.pressed(x - gap, stiffness * (x - gap) + damping * v)

        parts.stop(stop, body=0, factor=side)
    assert differs(machine, ("mass",), parts) < 1e-5 * 1e-3


@pytest.mark.parametrize(
    ("exponent", "stiffness", "loss", "chi"),
    [
        (1.5, 3e8, 'hertz_damping = "0.8 s/m"', 0.8),
        (10.0 / 9.0, 8e6, 'restitution = 0.6\nimpact_speed = "0.2 m/s"\nlaw = "flores"', 1.6 * 0.4 / 0.6 / 0.2),
    ],
    ids=["Hertz", "an exponent of 10/9"],
)
def test_a_ball_on_a_floor_whose_force_is_a_power(tmp_path, exponent, stiffness, loss, chi):
    """Above it a linear roof, beside it a spring that rises and falls over the cycle: to 1e-6 of the gap."""
    swing = "0.5, 0.6, 0.5, 0.4"
    text = HERTZIAN.format(exponent=repr(exponent), stiffness=stiffness, loss=loss)
    machine = read(tmp_path, text, ("0.5, 0.7, 0.9, 0.7, 0.5, 0.3, 0.1, 0.3", swing))
    machine = with_settings(machine, {"fidelity": "reference"})
    parts = Parts(0.5)
    parts.spring(0, 0.0, 2.0)
    sine, turn = parts.symbolic.sin, parts.symbolic.asin
    parts.spring_over_time(0, lambda t: 500.0 + 100.0 / (0.5 * math.pi) * turn(0.9999999 * sine(44.0 * math.pi * t)))
    parts.pull(0, 9.0, 22.0)
    parts.pull(0, -4.9, 0.0)

    def floor(x, v):
        depth = x - 0.5e-3
        power = parts.symbolic.pow(parts.symbolic.max(depth, 0.0), exponent)
        return parts.pressed(depth, stiffness * power * (1.0 + chi * v))

    parts.stop(floor, body=0, factor=-1.0)
    parts.stop(lambda x, v: parts.pressed(x - 0.4e-3, 1e6 * (x - 0.4e-3) + 40.0 * v), body=0)
    assert differs(machine, ("ball",), parts) < 1e-6 * 0.5e-3


WORK = np.array([0.0, 0.0, -4.0, -9.0, -4.0, 0.0, 0.0, 0.0, 0.0])
"""Moment of the press over a revolution [N m]."""


def press_forces(machine, cycles, step):
    """Force of the knee's pin at each step of some cycles, of the press as an Exudyn user builds it."""
    exudyn = load_exudyn()
    items, symbolic = exudyn.itemInterface, exudyn.symbolic
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())
    soon = 1e-4
    now, next_, after = machine.nominal_places(np.array([0.0, soon, 2.0 * soon]))
    rates = machine.crank_rate * (4.0 * next_ - 3.0 * now - after) / (2.0 * soon)
    nodes, bodies = {}, {"ground": ground}
    for name, mass, inertia, centre in (
        ("crank", 1.0, 1e4, 0.0), ("rod", 0.4, 1.3e-3, 0.095), ("rocker", 0.9, 1.2e-3, 0.06),
    ):  # fmt: skip
        own = machine.mechanism.at[name]
        nodes[name] = system.AddNode(
            items.NodeRigidBody2D(referenceCoordinates=now[own].tolist(), initialVelocities=rates[own].tolist())
        )
        bodies[name] = system.AddObject(
            items.ObjectRigidBody2D(
                nodeNumber=nodes[name], mass=mass, inertia=inertia + mass * centre**2, centerOfMass=[centre, 0.0]
            )
        )
        if name != "crank":
            weighed = system.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[name]))
            system.AddLoad(items.LoadMassProportional(markerNumber=weighed, loadVector=[0.0, -9.81, 0.0]))

    def at(body, x, y=0.0):
        return system.AddMarker(items.MarkerBodyPosition(bodyNumber=bodies[body], localPosition=[x, y, 0.0]))

    for ends in (
        [at("ground", 0.0), at("crank", 0.0)],
        [at("crank", 0.04), at("rod", 0.0)],
        [at("ground", 0.22, -0.04), at("rocker", 0.0)],
    ):
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
    system.AddObject(
        items.ObjectConnectorSpringDamper(
            markerNumbers=[at("ground", 0.22, 0.2), at("rocker", 0.12)],
            stiffness=2000.0, referenceLength=0.06, damping=0.0, force=15.0,
        )
    )  # fmt: skip
    turns = [system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[name])) for name in ("ground", "rocker")]
    system.AddObject(items.ObjectConnectorTorsionalSpringDamper(markerNumbers=turns, damping=0.02))
    orders = np.fft.rfft(WORK) / len(WORK)
    load = system.AddLoad(items.LoadTorqueVector(markerNumber=turns[1], loadVector=[0.0, 0.0, 1.0]))

    def work(mbs, t, load):
        turn, total = machine.crank_rate * t, orders[0].real
        for order, part in enumerate(orders[1:], 1):
            total = total + 2.0 * (part.real * symbolic.cos(order * turn) - part.imag * symbolic.sin(order * turn))
        return symbolic.Vector([0.0 * t, 0.0 * t, total])

    function = exudyn.utilities.CreateSymbolicUserFunction(system, work, "loadVectorUserFunction", load)
    system.SetLoadParameter(load, "loadVectorUserFunction", function)
    knee = add_pin(exudyn, system, [at("rod", 0.19), at("rocker", 0.12)], machine, "knee")
    sensor = system.AddSensor(
        items.SensorObject(objectNumber=knee, storeInternal=True, outputVariableType=exudyn.OutputVariableType.Force)
    )
    system.Assemble()
    steps = math.ceil(machine.cycle_period / step)
    setting = ExudynSetting("TrapezoidalIndex2", "law", step)
    settings = solver_settings(exudyn, machine.cycle_period, cycles, steps, setting)
    system.SolveDynamic(settings, solverType=exudyn.DynamicSolverType.TrapezoidalIndex2)
    force = np.linalg.norm(system.GetSensorStoredData(sensor)[-cycles * steps :, 1:3], axis=1)
    return force.reshape(cycles, steps)


def test_a_press_with_a_spring_a_moment_and_a_worn_pin(tmp_path):
    """Peaks of settling cycles are those of the full equations: to 2e-4 with a gap of 0.1 mm, 2e-5 with 0.02 mm."""
    page = (Path(__file__).parents[2] / "docs" / "own-mechanism.md").read_text()
    (text,) = (block for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "# of coils" in block)
    (tmp_path / "press.toml").write_text(text)
    for gap, tolerance in ((1e-4, 2e-4), (2e-5, 2e-5)):
        press = replace(chaosgym.read_machine(tmp_path / "press.toml"), knee_clearance=gap)
        own = chaosgym.simulate(press, 3).peak_force.max(axis=1)
        np.testing.assert_allclose(own[1:], press_forces(press, 3, 2e-5).max(axis=1)[1:], rtol=tolerance)
