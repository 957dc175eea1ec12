"""Kernels of machines whose matrices vary with an angle: held over each bin of it, contacts along rows of displacement.

Imported where such a machine runs; cached on disk as all kernels of ``core``.
"""

from chaosgym.core.kernel_cache import cached_by_content

with cached_by_content():
    from chaosgym.core.binned import (  # noqa: F401
        batch,
        cycle,
        fixed_step,
        look,
        motion,
        record,
        series,
        tables,
        taylor,
    )
