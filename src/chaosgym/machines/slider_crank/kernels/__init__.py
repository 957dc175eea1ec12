"""Compiled kernels of the slider crank, cached on disk by the content of their sources and of those of ``core``."""

from pathlib import Path

from chaosgym.core.kernel_cache import cached_by_content

with cached_by_content(Path(__file__).parent):
    from chaosgym.machines.slider_crank.kernels import (  # noqa: F401
        batch,
        exact,
        fixed_step,
        look,
        motion,
        propagator,
        record,
        series,
        stepped,
    )
