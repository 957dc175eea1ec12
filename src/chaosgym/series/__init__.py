"""Tests of any series of one sample a cycle: periodic, quasiperiodic or chaotic; they know no machine."""

from typing import TYPE_CHECKING, Any

from chaosgym.series.section_shape import section_shape
from chaosgym.series.spectrum import power_spectrum
from chaosgym.series.two_step import two_step_test
from chaosgym.series.verdict import TYPES, Diagnosis, Nature, Type
from chaosgym.series.zero_one import zero_one_statistic

if TYPE_CHECKING:
    from chaosgym.series.exponent import LyapunovExponent, exponent_from_series

__all__ = [
    "TYPES",
    "Diagnosis",
    "LyapunovExponent",
    "Nature",
    "Type",
    "exponent_from_series",
    "power_spectrum",
    "section_shape",
    "two_step_test",
    "zero_one_statistic",
]


def __getattr__(name: str) -> Any:
    """Exponents, which no verdict on a record asks for."""
    if name in ("LyapunovExponent", "exponent_from_series"):
        from chaosgym.series import exponent

        return getattr(exponent, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
