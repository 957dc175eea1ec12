"""Coordinates of small motions of a slider crank: only those that its scene requires.

Ball clearance opens the rod's end A along the rod and across it, slider clearance opens the slider across the guide,
both in the frames in which the bearing surfaces stand still. An instrumented slider turns; a flexible rod adds its
stretch and its modes. With the motor at an angle there is also the motion sideways.
"""

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
