"""Compiled kernels that serve every machine; they know numpy and numba only."""

from chaosgym.core.kernel_cache import cached_by_content

with cached_by_content():
    from chaosgym.core import (  # noqa: F401
        batch,
        contact,
        cubic,
        cycle,
        events,
        fixed_step,
        lanes,
        modal_impact,
        modal_model,
        propagator,
        status,
        tangent,
        varied,
    )
