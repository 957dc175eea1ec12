"""How right can a classifier of parameters be, when its labels change by themselves?

Nobody knows a parameter better than to a thousandth. How often the nature changes within that is measured by ``chaosgym
dataset noise``. Two definitions of the type, over the neighbours in two parameters and over all tolerances and initial
states, agree on a share of the points that have both.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from chaosgym.classifier.data import TYPES
from chaosgym.sweeps import LabelledSweep

VARIANT = "0.1 % in every parameter"


def ceilings(sweep: LabelledSweep, noise: Mapping[str, Any] | None) -> dict[str, float]:
    """Ceilings by label, as far as known: ``nature`` with its 95 % ``half_interval``, and ``response_type``.

    Parameters
    ----------
    sweep
        Labelled points, some of them with types by both definitions.
    noise
        What ``label_noise`` returned for the sweep.
    """
    found: dict[str, float] = {}
    if noise is not None and VARIANT in noise["changes"]:
        change = noise["changes"][VARIANT]
        found |= {"nature": 1.0 - change["nature"], "half_interval": change["half_interval"]}
    if "full_response_type" in sweep.table.column_names:
        types, full = (sweep.column(name).astype(object) for name in ("response_type", "full_response_type"))
        both = np.isin(types.astype(str), TYPES) & np.isin(full.astype(str), TYPES)
        if both.any():
            found["response_type"] = float(np.mean(types[both] == full[both]))
    return found
