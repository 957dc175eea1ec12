"""Compiled bookkeeping of a step, cached by the content of these sources."""

from pathlib import Path

from chaosgym.core.kernel_cache import cached_by_content

cached_by_content(Path(__file__).parent)
