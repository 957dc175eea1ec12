"""Kernels of machines of a few modes and any number of joints.

Imported where such a machine runs; cached on disk as all kernels of ``core``.
"""

from chaosgym.core.kernel_cache import cached_by_content

with cached_by_content():
    from chaosgym.core.joints import cycle, events, run, tables  # noqa: F401
