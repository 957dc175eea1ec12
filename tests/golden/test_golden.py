"""Results stay the same bit for bit while the code around them moves."""

import json

import pytest

from tests.golden import golden

STORED = json.loads(golden.STORED.read_text())


@pytest.mark.parametrize(
    ("part", "compute"), [("records", golden.records), ("labels", golden.labels), ("observations", golden.observations)]
)
def test_the_golden_set_is_repeated_bit_for_bit(part, compute):
    """Records, labels and observations are those that were kept, to the last digit."""
    if golden.versions() != (written := json.loads(golden.VERSIONS.read_text())):
        pytest.skip(f"the set was written with {written}")
    found = golden.plain(compute())
    assert sorted(found) == sorted(STORED[part])
    for name, values in STORED[part].items():
        assert found[name] == values, name
