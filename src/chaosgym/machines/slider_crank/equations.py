"""Small motions of a slider crank about its nominal motion: coordinates that its scene requires, and their equations.

Ball clearance opens the rod's end A along the rod and across it, slider clearance opens the slider across the guide,
both in the frames in which the bearing surfaces stand still. An instrumented slider turns; a flexible rod adds its
stretch and its modes. With the motor at an angle there is also the motion sideways. The equations are those of the
crank's mechanism, in the order of these coordinates.
"""

from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.mechanism.equations import assembled
from chaosgym.machines.slider_crank.mechanism import SLIDER, mechanism_of, revolution_of_crank
from chaosgym.machines.slider_crank.parameters import CrankParameters

BALL_ALONG = "ball along the rod"
BALL_ACROSS = "ball across the rod"
ROD_STRETCH = "rod stretch"
SLIDER_ACROSS = "slider across the guide"
SLIDER_PITCH = "slider pitch"
BALL_LATERAL = "ball sideways"
SLIDER_LATERAL = "slider sideways"
SLIDER_ROLL = "slider roll"
SLIDER_YAW = "slider yaw"
BALL_DIRECTIONS = (BALL_ALONG, BALL_ACROSS, BALL_LATERAL)
SLIDER_TURNS = (SLIDER_ROLL, SLIDER_YAW, SLIDER_PITCH)


def degrees_of_freedom(machine: CrankParameters) -> tuple[str, ...]:
    """Names of the coordinates that the scene of a machine requires, in their order."""
    spatial = machine.is_spatial
    names: list[str] = []
    if machine.ball_joint != "ideal":
        names += BALL_DIRECTIONS if spatial else BALL_DIRECTIONS[:2]
    if machine.rod == "flexible":
        names.append(ROD_STRETCH)
    if machine.slider_joint != "ideal":
        names.append(SLIDER_ACROSS)
        names += [SLIDER_LATERAL] if spatial else []
    if machine.slider_joint == "instrumented":
        names += SLIDER_TURNS if spatial else (SLIDER_PITCH,)
    if machine.rod == "flexible":
        modes = range(1, 1 + machine.n_modes + machine.fitted_modes)
        names += [f"rod mode {i}" for i in modes]
        names += [f"sideways rod mode {i}" for i in modes] if spatial else []
    return tuple(names)


class Equations(NamedTuple):
    """Matrices of M p'' + D p' + K p = -f + contact forces at B crank angles, by powers of the crank rate w.

    Attributes
    ----------
    mass : (B, n, n)
    damping : (2, B, n, n)
        D = damping[0] + w damping[1].
    stiffness : (3, B, n, n)
        K = stiffness[0] + w stiffness[1] + w^2 stiffness[2]; the second is zero.
    load : (2, L, n)
        f = load[0] + w^2 load[1]: gravity, and inertia of the nominal motion.
    slider_along : (B, n)
        Motion of the slider along the guide per unit coordinate; zero without friction.
    slider_rate : (B,)
        Its nominal motion per radian of the crank [m]; zero without friction.
    """

    mass: Array
    damping: Array
    stiffness: Array
    load: Array
    slider_along: Array
    slider_rate: Array


def equations(machine: CrankParameters, crank_angle: Array, load_angle: Array | None = None) -> Equations:
    """Assemble the equations of motion at given crank angles.

    Parameters
    ----------
    machine
        The mechanism.
    crank_angle : (B,)
        Crank angles [rad].
    load_angle : (L,), optional
        Those of the loads, if they are others.

    Examples
    --------
    >>> from chaosgym.machines.slider_crank.equations import equations
    >>> equations(chaosgym.SliderCrank(rod="rigid"), np.zeros(1)).mass.shape
    (1, 1, 1)
    """
    mechanism, names = mechanism_of(machine), degrees_of_freedom(machine)
    rubs = machine.friction_coefficient > 0.0
    whole = assembled(
        mechanism,
        revolution_of_crank(machine, mechanism),
        geometric=machine.geometric_stiffness == "on",
        rubbing=(SLIDER,) if rubs else (),
    )
    # the mechanism has its gaps first, then the stretch and the modes
    order = list(range(len(names)))
    if ROD_STRETCH in names:
        order.insert(names.index(ROD_STRETCH), order.pop(len(names) - len(mechanism.elastic)))
    ordered = whole._replace(matrices=whole.matrices[:, :, order][..., order], load=whole.load[..., order])
    load = ordered.load_at(crank_angle if load_angle is None else load_angle)
    rate, along = np.zeros(len(crank_angle)), np.zeros((len(crank_angle), len(order)))
    if rubs:
        slider = whole.rubbing_at(crank_angle)
        rate, along = slider.rate[0], slider.motion[0, order].T
    return Equations(*ordered.matrices_at(crank_angle), load[[0, 2]], along, rate)
