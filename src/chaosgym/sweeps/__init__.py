"""Many diagnoses: which machines to try, labelling them in parallel, and keeping the result as Parquet."""

from chaosgym.sweeps.axes import Axis
from chaosgym.sweeps.dataset import LabelledSweep, read_sweep
from chaosgym.sweeps.plan import SweepPlan
from chaosgym.sweeps.run import relabel, run_sweep

__all__ = ["Axis", "LabelledSweep", "SweepPlan", "read_sweep", "relabel", "run_sweep"]
