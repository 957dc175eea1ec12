"""The same bits on every processor."""

import pytest

from tests.golden.digests import PROCESSORS, on


def _differing(one, other):
    return [name for name in sorted(one.keys() | other.keys()) if one.get(name) != other.get(name)]


def test_a_motion_has_the_same_bits_on_an_old_and_a_new_processor():
    """Models, motions, verdicts and multipliers depend neither on the library of linear algebra nor on AVX-512."""
    new, *_, old = PROCESSORS
    assert _differing(on(new), on(old)) == []


@pytest.mark.slow
def test_all_machines_have_the_same_bits_on_every_processor():
    """Every scene, published machine, drawn machine and task, to the last bit, impacts and chaos included."""
    first, *others = (on(processor, "all") for processor in PROCESSORS)
    assert len(first) > 200
    assert [_differing(first, other) for other in others] == [[]] * (len(PROCESSORS) - 1)
