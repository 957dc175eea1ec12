"""Rates of this computer: numbers that a reader can rerun with ``python -m benchmarks bench``."""

from benchmarks.performance.mechanisms import assembly_times, cycle_costs
from benchmarks.performance.rates import benchmark
from benchmarks.performance.scenes import scene_costs
from benchmarks.performance.set_up import set_up_times

__all__ = ["assembly_times", "benchmark", "cycle_costs", "scene_costs", "set_up_times"]
