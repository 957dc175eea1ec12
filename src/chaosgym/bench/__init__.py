"""How fast is it here? Numbers that a reader can rerun with ``chaosgym bench``."""

from chaosgym.bench.rates import benchmark
from chaosgym.bench.timing import timed_run

__all__ = ["benchmark", "timed_run"]
