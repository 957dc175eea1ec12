"""Force of a bearing surface: a linear spring and damper that push and never pull (thesis 3.3)."""

from numba import njit


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
