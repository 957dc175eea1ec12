"""The ceiling of a classifier follows from how often labels change."""

import pyarrow as pa

from benchmarks.classifier.ceiling import ceilings
from chaosgym.sweeps import LabelledSweep


def test_ceiling_is_what_the_noise_of_the_labels_leaves():
    """Natures that change at 4 % leave 96 %; types agree at two of the three points that are known twice."""
    table = pa.table(
        {
            "response_type": ["I", "II", "III", "I", "undetermined"],
            "full_response_type": ["I", "III", "III", None, "I"],
        }
    )
    noise = {"changes": {"0.1 % in every parameter": {"nature": 0.04, "half_interval": 0.02}}}
    found = ceilings(LabelledSweep(table, {}), noise)
    assert found == {"nature": 0.96, "half_interval": 0.02, "response_type": 2 / 3}
    assert ceilings(LabelledSweep(table.select(["response_type"]), {}), None) == {}
