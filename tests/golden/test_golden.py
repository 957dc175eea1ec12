"""Results stay the same bit for bit while the code around them moves."""

import json

import numpy as np
import pytest

from tests.golden import golden

STORED = json.loads(golden.STORED.read_text())

SAME = golden.versions() == json.loads(golden.VERSIONS.read_text())
"""Whether the set was written with the versions at hand: others round otherwise."""


def numbers(field):
    """The numbers of one field of a record in its first cycle."""
    flat = np.ravel(field[0]) if field else []
    return np.array([float.fromhex(one) if isinstance(one, str) else one for one in flat], dtype=float)


@pytest.mark.skipif(SAME, reason="the next test compares every bit")
def test_the_golden_records_begin_alike_with_other_versions():
    """Two cycles after rest a record of other versions differs by rounding, not yet by what chaos makes of it."""
    found = golden.plain(golden.records())
    assert sorted(found) == sorted(STORED["records"])
    for name, fields in STORED["records"].items():
        for field, values in fields.items():
            kept = numbers(values)
            np.testing.assert_allclose(
                numbers(found[name][field]), kept, rtol=0.0, atol=1e-5 * np.abs(kept).max(initial=0.0), err_msg=name
            )


@pytest.mark.skipif(not SAME, reason="the golden set was written with other versions")
@pytest.mark.parametrize(
    ("part", "compute"), [("records", golden.records), ("labels", golden.labels), ("observations", golden.observations)]
)
def test_the_golden_set_is_repeated_bit_for_bit(part, compute):
    """Records, labels and observations are those that were kept, to the last digit."""
    found = golden.plain(compute())
    assert sorted(found) == sorted(STORED[part])
    for name, values in STORED[part].items():
        assert found[name] == values, name
