r"""Positions of the links of a slider crank with every joint tight.

Vector loop of the mechanism. X runs along the guide from the crank to the slider, Y upward, Z = X x Y is the motor axis
at zero motor angle; the crank angle is zero at the outer dead point. With crank pin P and slider pivot S = (s, 0, 0)

    P = r (cos th cos b, sin th, -cos th sin b),   s = P_x + sqrt(l^2 - P_y^2 - P_z^2)

where b is the motor angle: the crank plane turns about Y through its own centre.

The crank turns at a constant rate w, so d/dt = w d/dth: everything here is given per unit crank rate.
"""

import numpy as np

from chaosgym.arrays import Array


def crank_pin(crank_angle: Array, radius: float, motor_angle: float) -> Array:
    """Position (B, 3) [m] of the crank pin; ``motor_angle`` in radians."""
    return radius * np.stack(
        [
            np.cos(crank_angle) * np.cos(motor_angle),
            np.sin(crank_angle),
            -np.cos(crank_angle) * np.sin(motor_angle),
        ],
        axis=-1,
    )


def slider_position(crank_angle: Array, radius: float, length: float, motor_angle: float) -> Array:
    """Position (B,) [m] of the slider pivot along the guide; ``motor_angle`` in radians."""
    pin = crank_pin(crank_angle, radius, motor_angle)
    return np.asarray(pin[..., 0] + np.sqrt(length**2 - pin[..., 1] ** 2 - pin[..., 2] ** 2))
