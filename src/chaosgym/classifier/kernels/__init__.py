"""Compiled kernels of the classifier's rows, cached by the content of these sources."""

from pathlib import Path

from chaosgym.core.kernel_cache import cached_by_content

with cached_by_content(Path(__file__).parent):
    from chaosgym.classifier.kernels import parameters, records, trees  # noqa: F401
