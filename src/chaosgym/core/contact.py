"""What force does a bearing surface exert? Linear stiffness and damping that push and never pull (thesis 3.3)."""

from numba import njit


@njit(cache=True, inline="always")
def contact_force(penetration, penetration_rate, stiffness, damping):
    """Force [N] of one bearing surface on the tip, positive away from the surface.

    ``penetration`` [m] is how far the tip lies beyond the surface (negative inside the gap), ``penetration_rate``
    [m/s] its rate. The surface is a spring and a damper in parallel without adhesion: zero inside the gap, and zero
    beyond the surface as soon as spring and damper together would pull.
    """
    if penetration <= 0.0:
        return 0.0
    return max(0.0, stiffness * penetration + damping * penetration_rate)
