"""How fast is it here? Numbers that a reader can rerun with ``chaosgym bench``."""

from chaosgym.bench.rates import benchmark
from chaosgym.bench.scaling import vector_scaling
from chaosgym.bench.scenes import scene_costs
from chaosgym.bench.set_up import set_up_times
from chaosgym.bench.timing import timed_run

__all__ = ["benchmark", "scene_costs", "set_up_times", "timed_run", "vector_scaling"]
