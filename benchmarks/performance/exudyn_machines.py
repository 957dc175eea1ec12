"""The same machines in Exudyn, the best general simulator for them, driven as its manual advises.

The impact beam is that of ``chaosgym.envs.exudyn_beam``: both integrate the same equations. A mechanism
of rigid links has the same bodies, joints and contact law, and turns by any angle: its equations are Exudyn's own. The
slider crank is what an Exudyn user would build of the same parts: geometrically exact beam elements whose end nodes
carry housing and yoke, a flywheel so heavy that it turns at constant speed, a slider.

Sources: exudyn.readthedocs.io, reference manual of the items used; Exudyn is written by J. Gerstmayr.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.performance.timing import processor_seconds
from chaosgym.arrays import Array
from chaosgym.envs.exudyn_beam import add_beam, add_stops, load_exudyn, settings_of
from chaosgym.machines.impact_beam import ImpactBeam
from chaosgym.machines.machine import Machine
from chaosgym.machines.mechanism.joints import GROUND
from chaosgym.machines.mechanism.machine import MechanismMachine
from chaosgym.machines.slider_crank import SliderCrank

NEWTON_TOLERANCE = 1e-6
"""Below this the Newton iteration of an elastic body that starts from rest stalls in rounding."""

ELEMENTS = 8
"""Beam elements of the connecting rod."""

FLYWHEEL_INERTIA = 1e4
"""Moment of inertia [kg m^2] of a crank whose speed the mechanism does not change."""


@dataclass(frozen=True)
class ExudynSetting:
    """How Exudyn runs a machine.

    Attributes
    ----------
    solver
        Name of its ``DynamicSolverType``.
    contact
        "stop": the built-in limit stop. "law": our contact law as a user function, compiled by ``exudyn.symbolic``.
    step
        Time step [s], shortened to a whole number in a cycle.
    switch_tolerance
        Force [N] by which a limit stop may switch late; None for Exudyn's default of 1 N.
    """

    solver: str
    contact: str
    step: float
    switch_tolerance: float | None = None

    def __str__(self) -> str:
        switched = "" if self.switch_tolerance is None else f", switched within {self.switch_tolerance:g} N"
        contact = "limit stop" if self.contact == "stop" else "contact law as symbolic function"
        return f"{self.solver}, {contact}{switched}, step {self.step:g} s"


def run_in_exudyn(machine: Machine, cycles: int, setting: ExudynSetting, *, forces: bool) -> tuple[float, Array | None]:
    """Run a machine from rest in Exudyn.

    Parameters
    ----------
    machine
        An impact beam, a slider crank with clearance at the slider, or a mechanism of rigid links and pins.
    cycles
        Operating cycles.
    setting
        How.
    forces
        Whether to record the contact force, which takes time.

    Returns
    -------
    (seconds, peak_force)
        Processor time of the run; peak force of each cycle on the first surface, or on a pin, (cycles,), or None.
    """
    if isinstance(machine, MechanismMachine):
        return _run_mechanism(machine, cycles, setting, forces)
    exudyn = load_exudyn()
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    if isinstance(machine, ImpactBeam):
        parts = add_beam(exudyn, system, machine)
        node, coordinate, first = parts.node, 0, 1.0
        gap, stiffness, damping = machine.clearance, machine.contact_stiffness, machine.contact_damping
        _add_contact(exudyn, system, parts.tip, setting, gap, stiffness, damping)
    else:
        assert isinstance(machine, SliderCrank)
        # the first surface of the guide pushes upward, so it lies below the slider
        node, coordinate, first = *_add_crank(exudyn, system, machine, setting), -1.0
        gap, stiffness, damping = machine.slider_clearance, machine.contact_stiffness, machine.contact_damping
    sensors = []
    if forces:
        kinds = exudyn.OutputVariableType
        for kind in (kinds.Coordinates, kinds.Coordinates_t):
            sensor = exudyn.itemInterface.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind)
            sensors.append(system.AddSensor(sensor))
    system.Assemble()
    steps = math.ceil(machine.cycle_period / setting.step)
    settings = solver_settings(exudyn, machine.cycle_period, cycles, steps, setting)
    solver = getattr(exudyn.DynamicSolverType, setting.solver)
    seconds = processor_seconds(lambda: system.SolveDynamic(settings, solverType=solver))
    if not forces:
        return seconds, None
    x, v = (first * system.GetSensorStoredData(sensor)[-cycles * steps :, 1 + coordinate] for sensor in sensors)
    force = np.where(x > gap, np.maximum(stiffness * (x - gap) + damping * v, 0.0), 0.0)
    return seconds, force.reshape(cycles, steps).max(axis=1)


def _run_mechanism(
    machine: MechanismMachine, cycles: int, setting: ExudynSetting, forces: bool
) -> tuple[float, Array | None]:
    """``run_in_exudyn`` of a mechanism whose only gap is a pin in its hole."""
    exudyn = load_exudyn()
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    sensor = _add_mechanism(exudyn, system, machine, forces)
    system.Assemble()
    steps = math.ceil(machine.cycle_period / setting.step)
    settings = solver_settings(exudyn, machine.cycle_period, cycles, steps, setting)
    solver = getattr(exudyn.DynamicSolverType, setting.solver)
    seconds = processor_seconds(lambda: system.SolveDynamic(settings, solverType=solver))
    if sensor is None:
        return seconds, None
    force = np.linalg.norm(system.GetSensorStoredData(sensor)[-cycles * steps :, 1:3], axis=1)
    return seconds, force.reshape(cycles, steps).max(axis=1)


def solver_settings(exudyn: Any, period: float, cycles: int, steps: int, setting: ExudynSetting) -> Any:
    """``settings_of``, with those of implicit solvers and the tolerance of limit stops."""
    settings = settings_of(exudyn, period, cycles, steps)
    settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.newton.absoluteTolerance = NEWTON_TOLERANCE
    if setting.switch_tolerance is not None:
        settings.timeIntegration.discontinuous.iterationTolerance = setting.switch_tolerance
    return settings


def _add_contact(
    exudyn: Any, system: Any, marker: int, setting: ExudynSetting, gap: float, stiffness: float, damping: float
) -> None:
    """Put two surfaces around the coordinate of a marker."""
    if setting.contact == "law":
        add_stops(exudyn, system, marker, gap, stiffness, damping)
        return
    items = exudyn.itemInterface
    fixed = system.AddNode(items.NodePointGround())
    ground = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))
    data = system.AddNode(items.NodeGenericData(initialCoordinates=[0, 0, 0], numberOfDataCoordinates=3))
    system.AddObject(
        items.ObjectConnectorCoordinateSpringDamperExt(
            markerNumbers=[ground, marker],
            nodeNumber=data,
            useLimitStops=True,
            limitStopsUpper=gap,
            limitStopsLower=-gap,
            limitStopsStiffness=stiffness,
            limitStopsDamping=damping,
        )
    )


def _add_mechanism(exudyn: Any, system: Any, machine: MechanismMachine, forces: bool) -> Any:
    """Add rigid links on their nominal motion at crank angle zero; the sensor of the pin's force, if asked for."""
    items, mechanism = exudyn.itemInterface, machine.mechanism
    step = 1e-4
    now, next_, after = machine.nominal_places(np.array([0.0, step, 2.0 * step]))
    rates = machine.crank_rate * (4.0 * next_ - 3.0 * now - after) / (2.0 * step)
    bodies = {GROUND: system.AddObject(items.ObjectGround())}
    for link in mechanism.links:
        own, mass = mechanism.at[link.name], float(link.mass.sum())
        places = link.masses.place
        centre = link.mass @ places / mass if mass else np.zeros(2)
        inertia = float(link.inertia.sum() + link.mass @ np.sum(places**2, axis=1))
        driven = link.name == mechanism.driver.second[0]
        node = system.AddNode(
            items.NodeRigidBody2D(referenceCoordinates=now[own].tolist(), initialVelocities=rates[own].tolist())
        )
        bodies[link.name] = system.AddObject(
            items.ObjectRigidBody2D(
                nodeNumber=node,
                mass=mass or 1.0,
                inertia=FLYWHEEL_INERTIA if driven else inertia,
                centerOfMass=centre.tolist(),
            )
        )
        weighed = system.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[link.name]))
        system.AddLoad(items.LoadMassProportional(markerNumber=weighed, loadVector=[*mechanism.gravity, 0.0]))

    def marker(end: tuple[str, str]) -> Any:
        place = mechanism.ground[end[1]] if end[0] == GROUND else mechanism.link(end[0]).points[end[1]].place[0]
        return system.AddMarker(
            items.MarkerBodyPosition(bodyNumber=bodies[end[0]], localPosition=[*map(float, place), 0.0])
        )

    pin: Any = None
    for joint in mechanism.joints:
        ends = [marker(joint.first), marker(joint.second)]
        if joint.opened:
            pin = add_pin(exudyn, system, ends, machine, joint.name)
        else:
            system.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
    if not forces:
        return None
    kind = exudyn.OutputVariableType.Force
    return system.AddSensor(items.SensorObject(objectNumber=pin, storeInternal=True, outputVariableType=kind))


def add_pin(exudyn: Any, system: Any, ends: list[Any], machine: MechanismMachine, joint: str) -> Any:
    """Put a pin into its hole; without a stiffness of its own, from which Exudyn would take a wrong Jacobian."""
    symbolic = exudyn.symbolic
    gap, stiffness, damping = (getattr(machine, f"{joint}_{name}") for name in ("clearance", "stiffness", "damping"))
    spring = system.AddObject(
        exudyn.itemInterface.ObjectConnectorCartesianSpringDamper(
            markerNumbers=ends, stiffness=[0.0] * 3, damping=[0.0] * 3
        )
    )

    def force(mbs: Any, t: Any, item: Any, x: Any, v: Any, k: Any, d: Any, c: Any) -> Any:
        size = symbolic.sqrt(x[0] * x[0] + x[1] * x[1] + 1e-30)
        depth = size - gap
        push = symbolic.max(0.0, stiffness * depth + damping * (x[0] * v[0] + x[1] * v[1]) / size)
        push = push * (0.5 * symbolic.sign(depth) + 0.5)
        return symbolic.Vector([push * x[0] / size, push * x[1] / size, 0.0 * x[0]])

    name = "springForceUserFunction"
    compiled = exudyn.utilities.CreateSymbolicUserFunction(system, force, name, spring)
    system.SetObjectParameter(spring, name, compiled)
    return spring


def _add_crank(exudyn: Any, system: Any, crank: SliderCrank, setting: ExudynSetting) -> tuple[int, int]:
    """Add a planar slider crank at crank angle zero on its nominal motion; the slider's node and its y coordinate."""
    items = exudyn.itemInterface
    radius, length, speed = crank.crank_radius, crank.rod_length, crank.crank_rate
    flywheel = system.AddNode(items.NodeRigidBody2D(initialVelocities=[0.0, 0.0, speed]))
    wheel = system.AddObject(items.ObjectRigidBody2D(nodeNumber=flywheel, mass=1.0, inertia=FLYWHEEL_INERTIA))
    hub = system.AddMarker(items.MarkerBodyPosition(bodyNumber=system.AddObject(items.ObjectGround())))
    pin = system.AddMarker(items.MarkerBodyPosition(bodyNumber=wheel, localPosition=[radius, 0.0, 0.0]))
    system.AddObject(
        items.ObjectJointRevolute2D(markerNumbers=[hub, system.AddMarker(items.MarkerBodyPosition(bodyNumber=wheel))])
    )

    nodes = [
        system.AddNode(
            items.NodeRigidBody2D(
                referenceCoordinates=[radius + share * length, 0.0, 0.0],
                initialVelocities=[0.0, radius * speed * (1.0 - share), -radius * speed / length],
            )
        )
        for share in np.linspace(0.0, 1.0, ELEMENTS + 1).tolist()
    ]
    area, inertia = math.pi * crank.rod_diameter**2 / 4.0, math.pi * crank.rod_diameter**4 / 64.0
    bending, axial = crank.youngs_modulus * inertia, crank.youngs_modulus * area
    delay = 2.0 * crank.damping_ratio / (2.0 * math.pi * float(crank.natural_frequencies[0]))
    for first, last in pairwise(nodes):
        system.AddObject(
            items.ObjectBeamGeometricallyExact2D(
                nodeNumbers=[first, last],
                length=length / ELEMENTS,
                massPerLength=crank.density * area,
                crossSectionInertia=crank.density * inertia,
                bendingStiffness=bending,
                axialStiffness=axial,
                shearStiffness=0.35 * axial,
                bendingDamping=delay * bending,
                axialDamping=delay * axial,
                shearDamping=delay * 0.35 * axial,
            )
        )
    ends = []
    for node, mass, moment, offset in (
        (nodes[0], crank.housing_mass, crank.housing_inertia, crank.housing_offset_along),
        (nodes[-1], crank.yoke_mass, crank.yoke_inertia, crank.yoke_offset_along),
    ):
        body = system.AddObject(
            items.ObjectRigidBody2D(nodeNumber=node, mass=mass, inertia=moment, centerOfMass=[offset, 0.0])
        )
        ends.append(system.AddMarker(items.MarkerBodyPosition(bodyNumber=body)))
    slider = system.AddNode(items.NodePoint2D(referenceCoordinates=[radius + length, 0.0]))
    block = system.AddObject(items.ObjectMassPoint2D(nodeNumber=slider, mass=crank.slider_mass))
    system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[pin, ends[0]]))
    system.AddObject(
        items.ObjectJointRevolute2D(
            markerNumbers=[ends[1], system.AddMarker(items.MarkerBodyPosition(bodyNumber=block))]
        )
    )
    across = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=slider, coordinate=1))
    gap, stiffness, damping = crank.slider_clearance, crank.contact_stiffness, crank.contact_damping
    _add_contact(exudyn, system, across, setting, gap, stiffness, damping)
    return slider, 1
