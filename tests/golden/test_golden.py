"""Results keep their meaning while the code around them changes, and kernels their bits."""

import json

import numpy as np
import pytest

from tests.golden import bits, golden
from tests.golden.scenes import scenes

SCENES = dict(scenes())

KEPT = json.loads(golden.STORED.read_text())


def labels():
    """Labels, the kept ones where only rounding tells others."""
    return golden.labels(KEPT["labels"])


PARTS = [golden.cycles, golden.steps, pytest.param(labels, marks=pytest.mark.slow)]


@pytest.mark.parametrize("part", PARTS, ids=["cycles", "steps", "labels"])
def test_results_mean_what_they_did(part):
    """First cycles and steps are equal to a millionth or as rounding is magnified, 400 natures and periods are equal.

    What is shipped was computed with these; a change says by `python -m tests.golden.golden` what it makes stale.
    """
    assert golden.differences(part(), KEPT[part.__name__]) == {}


def test_a_difference_beyond_rounding_is_told():
    """A number off by 1e-5 of the largest, another label, another shape and a missing entry are; rounding is not."""
    kept = {"a": [1.0, 100.0], "b": "chaotic", "c": [1.0], "d": None, "e": [1.0]}
    assert golden.differences({**kept, "a": [1.00005, 100.0], "d": "chaotic"}, kept) == {}
    found = {"a": [1.001, 100.0], "b": "periodic 1", "c": [[1.0]], "d": "periodic 1"}
    assert list(golden.differences(found, kept)) == ["a", "b", "c", "e"]
    assert list(golden.differences({**kept, "a": [float("nan"), 100.0]}, kept)) == ["a"]


def test_the_tolerance_of_an_entry_follows_its_condition():
    """An entry that magnifies changes 1e5 times may differ by 1e-5 of its largest number, not by twice that."""
    kept, condition = {"a": [1.0, 100.0], "b": [100.0]}, {"a": 1e5, "b": 1.0}
    assert golden.differences({"a": [1.0009, 100.0], "b": [100.0]}, kept, condition) == {}
    assert list(golden.differences({"a": [1.002, 100.0], "b": [100.0009]}, kept, condition)) == ["a", "b"]


@pytest.mark.parametrize("name", SCENES)
def test_a_changed_parameter_is_noticed_in_every_scene(name):
    """A speed or a clearance off by 1e-5 moves an entry of its scene further than rounding of the model may."""
    kept = {entry: value for entry, value in KEPT["cycles"].items() if entry.startswith(f"{name}: ")}
    machine = SCENES[name]
    speed, clearance = (getattr(machine, field) for field in (machine.speed_field, machine.clearance_field))
    for other in (machine.at(speed=1.00001 * speed), machine.at(clearance=1.00001 * clearance)):
        record = {entry: golden.plain(value) for entry, value in golden.record_of(name, other).items()}
        assert golden.differences(record, kept)


@pytest.mark.slow
def test_condition_numbers_are_those_of_the_scenes():
    """They follow from the machines to a tenth: nobody has chosen a tolerance."""
    kept, found = json.loads(golden.CONDITIONS.read_text()), golden.conditions()
    assert found == pytest.approx(kept, rel=0.1, abs=0.1)


@pytest.mark.parametrize("name", bits.MACHINES)
def test_models_repeat_their_bits(name):
    """Eigenvectors, inverses and what follows from them, whatever the processor; a table is working space."""
    with np.load(bits.STORED) as stored:
        for field, found in bits.arrays_of(bits.MACHINES[name].reduce(), f"{name}: model").items():
            if not field.endswith(".table"):
                np.testing.assert_array_equal(found, stored[field], err_msg=field)


@pytest.mark.parametrize("name", bits.MACHINES)
def test_kernels_repeat_their_bits(name):
    """From a stored model a kernel writes the same events, forces, states and deviations to the last digit.

    Its compiler must be the one that wrote the bits; else the first two cycles agree to a billionth, some 1e6
    roundings: no scene magnifies one by more (``conditions.json``).
    """
    machine = bits.MACHINES[name]
    with np.load(bits.STORED) as stored:
        found = bits.results(machine, bits.rebuilt(machine.reduce(), f"{name}: model", stored))
        same = all(stored[package] == version for package, version in bits.versions().items())
        for field, value in found.items():
            kept = stored[f"{name}: {field}"]
            if same:
                np.testing.assert_array_equal(value, kept, err_msg=field)
            elif len(kept) == bits.CYCLES:
                kept, scale = kept[:2], np.abs(kept).max()
                np.testing.assert_allclose(value[:2], kept, rtol=0.0, atol=1e-9 * scale, err_msg=field)
