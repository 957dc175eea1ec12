"""Contact with a bearing surface: the force of a spring and damper that never pull (thesis 3.3), and bouncing."""

from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.kernel import leaf, njit


@njit(cache=True, inline="always")
def pressing_force(penetration, penetration_rate, stiffness, damping):
    """Force [N] of spring and damper of a surface in contact, positive away from it; negative where they would pull.

    ``penetration`` [m] is how far the tip lies beyond the surface, ``penetration_rate`` [m/s] its rate. The law is
    linear, so the rates of both give the rate of the force [N/s].
    """
    return stiffness * penetration + damping * penetration_rate


@njit(cache=True, inline="always")
def contact_force(penetration, penetration_rate, stiffness, damping):
    """Force [N] of a surface on the tip: zero inside the gap, and beyond it as soon as spring and damper would pull."""
    if penetration <= 0.0:
        return 0.0
    return max(0.0, pressing_force(penetration, penetration_rate, stiffness, damping))


@leaf
def note_touch(bouncing, joints, j, side, time, bounce_time):
    """Go on bouncing at joint j, or end it and begin anew when the other surface is touched.

    ``bouncing`` (3m,): of all m joints the surface, +1, -1, or 0 before the first touch; then of each the instants of
    the first and the last touch of it [s], counted from the start of the coming cycle.
    """
    first = joints + 2 * j
    if bouncing[j] != side:
        if bouncing[j] != 0.0:
            column = 2 * j + (UPPER if bouncing[j] > 0.0 else LOWER)
            bounce_time[column] = max(bounce_time[column], bouncing[first + 1] - bouncing[first])
        bouncing[j] = side
        bouncing[first] = time
    bouncing[first + 1] = time


@leaf
def let_pass(bouncing, joints, period):
    """Count the instants of touches from the start of the next cycle."""
    for i in range(joints, bouncing.shape[0]):
        bouncing[i] -= period
