"""The bounds that physics sets to a run from rest: of energy where only the drive gives any, else of an impact."""

import math
from functools import singledispatch

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines import Machine, SliderCrank
from chaosgym.machines.abilities import Flexible
from chaosgym.machines.mechanism.machine import MechanismMachine
from chaosgym.machines.mechanism.nominal import even_angles
from chaosgym.machines.modal_impact import ModalImpactMachine
from chaosgym.machines.modal_machine.jointed import JointedMachine


@singledispatch
def bounded_share(machine: Machine, states: Array, peak_force: Array) -> float:
    """Largest ratio of a run from rest to its bound, at most 1 but for rounding; 0 where nothing bounds a run.

    So it is where surfaces slide or stiffness varies over the cycle, which may give any power.

    Parameters
    ----------
    states : (cycles + 1, n_states)
        States at the beginning of each cycle, and at the end.
    peak_force : (cycles, sides)
        Peak forces [N].
    """
    return 0.0


@bounded_share.register
def _(machine: ModalImpactMachine, states: Array, peak_force: Array) -> float:
    model = machine.reduce()
    surfaces = model.contact_stiffness[None], model.contact_damping[None], model.stops[None]
    return passive_share(machine.flexible, *surfaces, machine.cycle_period, states, peak_force)


@bounded_share.register
def _(machine: JointedMachine, states: Array, peak_force: Array) -> float:
    sets = machine.sets
    if sets.sliders.speed.any():
        return 0.0
    surfaces = sets.springs, sets.dampers, machine.stops
    return passive_share(machine.without_friction, *surfaces, machine.cycle_period, states, peak_force)


@bounded_share.register
def _(machine: MechanismMachine, states: Array, peak_force: Array) -> float:
    return float(peak_force.max()) / largest_force(machine)


@bounded_share.register
def _(machine: SliderCrank, states: Array, peak_force: Array) -> float:
    return float(peak_force.max()) / force_bound(machine)


def passive_share(
    flexible: Flexible, springs: Array, dampers: Array, stops: Array, period: float, states: Array, peak_force: Array
) -> float:
    """Largest ratio of energy and force of a run from rest to their bounds, as ``bounded_share``.

    Neither structure nor contact gives energy: only the drive does, and what preloads or offsets have stored. So
    the root of twice the energy grows by at most the norm of the modal forces a second.

    Parameters
    ----------
    springs, dampers, stops : (m, 2)
        Of the upper and the lower surface of each joint [N/m], [N s/m]; their positions [m].
    period
        Of a cycle [s].
    """
    n = len(flexible.stiffness)
    energy = np.sum(states[:, n : 2 * n] ** 2 + flexible.stiffness * states[:, :n] ** 2, axis=1)
    load = float(np.sum(np.linalg.norm(flexible.drive, axis=(1, 2)))) + float(np.linalg.norm(flexible.static))
    inside = np.maximum(np.stack([-stops[:, 0], stops[:, 1]], axis=1), 0.0)
    stored = math.sqrt(float(np.sum(springs * inside**2)))
    speed = stored + load * np.arange(1, len(states)) * period
    if not speed.any():
        return 0.0 if not energy.any() and not peak_force.any() else math.inf
    surface = np.sqrt(springs) + dampers * np.linalg.norm(flexible.joints, axis=1)[:, None]
    forces = peak_force / (surface.ravel() * speed[:, None])
    return max(float(np.max(np.sqrt(energy[1:]) / speed)), float(np.max(forces)))


def force_bound(crank: SliderCrank) -> float:
    """Force [N] of an impact of all moving masses at ten times the speed of the crank pin.

    The motor may give any power, so that there is no bound of energy. What turns with the rod counts as the mass at its
    end that has the same inertia.
    """
    rod = crank.density * crank.rod_length * math.pi / 4.0 * crank.rod_diameter**2
    turning = (crank.yoke_inertia + crank.housing_inertia) / crank.rod_length**2
    mass = crank.slider_mass + crank.yoke_mass + crank.housing_mass + rod + turning
    speed = 10.0 * (crank.crank_radius * crank.crank_rate + math.sqrt(crank.gravity * crank.rod_length))
    damping = crank.contact_damping * math.sqrt(mass / (crank.slider_mass + crank.yoke_mass))
    bound = (math.sqrt(crank.contact_stiffness * mass) + damping) * speed
    if crank.contact_law == "hertz":
        # k of the secant at the reference force; stiffer in proportion to the cube root of a larger force
        bound *= max(1.0, bound / crank.hertz_reference_force) ** 0.2
    return bound


def largest_force(machine: MechanismMachine) -> float:
    """Force [N] of an impact of all masses at ten times the speed of the nominal motion."""
    mechanism = machine.scaled()
    theta = even_angles(72)
    z, mass, fastest, load = machine.nominal_places(theta), 0.0, 0.0, 0.0
    for link in mechanism.links:
        own, places = z[:, mechanism.at[link.name]], (*link.points.values(), link.masses)
        moved = np.concatenate([each.moved(own) for each in places], axis=1)
        fastest = max(fastest, float(np.ptp(moved, axis=0).max(initial=0.0)))
        mass += float(link.mass.sum() + link.inertia.sum() / max(machine.revolution.length, 1e-9) ** 2)
    for force in mechanism.forces:
        load += float(np.abs(force.at(theta)).max()) / (machine.revolution.length if force.turns else 1.0)
    for held in mechanism.torsion:
        apart = z @ (mechanism.turn_of(held.second) - mechanism.turn_of(held.first)) - held.free_angle
        load += held.stiffness * float(np.abs(apart).max()) / machine.revolution.length
    for spring in mechanism.springs:
        apart = mechanism.apart(z, spring.first, spring.second)[0]
        load += spring.stiffness * float(np.abs(np.linalg.norm(apart, axis=1) - spring.free_length).max())
    gravity = math.hypot(*mechanism.gravity)
    speed = 10.0 * (fastest * machine.crank_rate + math.sqrt(gravity * machine.revolution.length))
    speed += 10.0 * load * machine.cycle_period / mass
    damper = max(contact.damping for contact in machine.contacts)
    largest = (math.sqrt(machine.stiffest * mass) + damper) * speed
    for contact in machine.contacts:
        # all energy in one surface: K x^(n + 1) / (n + 1) = m v^2 / 2
        n = contact.exponent
        if n:
            depth = (0.5 * (n + 1.0) * mass * speed**2 / contact.stiffness) ** (1.0 / (n + 1.0))
            largest = max(largest, contact.stiffness * depth**n * (1.0 + damper * speed))
    return largest
