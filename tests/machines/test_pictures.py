"""Pictures of machines are true: rigid parts keep their lengths, gaps are drawn as large as told, all of it fits."""

import re

import numpy as np
import pytest

from chaosgym import ImpactBeam, SliderCrank, simulate
from chaosgym.machines import MACHINES

SAMPLES = 60
FILES = ["four-bar-akhadkar", "compressor", "quick-return", "scotch-yoke", "slider-crank-thesis-15deg"]
CRANKS = [
    SliderCrank(),
    SliderCrank(crank_radius=0.2, rod_length=0.25),
    SliderCrank(slider_joint="ideal", ball_joint="spherical"),
]


def sketched(machine):
    """Record of two cycles, and the machine at all samples of the last one."""
    record = simulate(machine, 2, transient=5, samples_per_cycle=SAMPLES).of_joint()
    return record, machine.sketch(record, np.arange(SAMPLES, 2 * SAMPLES), 100.0)


def lengths_of(shape):
    """Lengths (moments, k - 1) of the pieces of a line."""
    return np.linalg.norm(np.diff(shape.points[:, 0], axis=1), axis=-1)


def check_it_fits(sketch):
    """Whatever moves but the bar of the force stays between the corners."""
    for shape in sketch.shapes:
        if shape.colour is not None:
            assert (shape.points >= sketch.low - 1e-9).all()
            assert (shape.points <= sketch.high + 1e-9).all()


@pytest.mark.parametrize("name", FILES)
def test_links_keep_their_lengths_through_a_revolution(name):
    """In the plane each drawn link is rigid, and the crank turns once; as seen along z a link may look shorter."""
    machine = MACHINES[f"docs/machines/{name}.toml"]()
    _, sketch = sketched(machine)
    links = [shape for shape in sketch.shapes if shape.kind == "line" and len(shape.points) == SAMPLES and shape.colour]
    links = [shape for shape in links if shape.points.shape[2] < 10]
    assert links
    for shape in links:
        lengths = lengths_of(shape)
        if machine.mechanism.dimensions == 2:
            np.testing.assert_allclose(lengths, lengths[:1].repeat(SAMPLES, axis=0), rtol=1e-9)
    crank = max(links, key=lambda shape: shape.width)
    first, last = crank.points[:, 0, 0], crank.points[:, 0, -1]
    turned = np.unwrap(np.arctan2(*(last - first).T[::-1]))
    assert abs(turned[-1] - turned[0]) == pytest.approx(2.0 * np.pi * (1.0 - 1.0 / SAMPLES), rel=1e-2)
    check_it_fits(sketch)


@pytest.mark.parametrize("name", FILES)
def test_the_dot_is_the_motion_in_the_gap_as_large_as_told(name):
    """Its distance from the joint's middle is the displacement, times the number in the title."""
    record, sketch = sketched(MACHINES[f"docs/machines/{name}.toml"]())
    (dot,) = [shape for shape in sketch.shapes if shape.kind == "dot" and shape.colour is None]
    (ring,) = [shape for shape in sketch.shapes if shape.kind == "line" and shape.points.shape[2] == 60]
    middle = ring.points[:, 0, :-1].mean(axis=1)
    times = float(re.search(r"drawn (\d+) times", sketch.title)[1])
    seen = np.linalg.norm(dot.points[:, 0, 0] - middle, axis=1)
    np.testing.assert_allclose(seen, times * np.abs(record.history[1, :, 0]), rtol=0.05, atol=1e-9)


@pytest.mark.parametrize("machine", CRANKS)
def test_a_crank_of_any_size_fits_and_keeps_its_lengths(machine):
    """Crank to rod is as the fields say, up to the exaggerated gap, and both fill the picture."""
    _, sketch = sketched(machine)
    crank, rod = sorted((s for s in sketch.shapes if s.kind == "line"), key=lambda s: s.width)[-1:-3:-1]
    np.testing.assert_allclose(lengths_of(crank), lengths_of(crank)[0, 0], rtol=1e-9)
    np.testing.assert_allclose(
        lengths_of(rod) / lengths_of(crank), machine.rod_length / machine.crank_radius, rtol=0.05
    )
    check_it_fits(sketch)


def test_a_crank_that_presses_a_stop_is_drawn_at_it():
    """The slider's block touches the guide where its force is large, and never goes beyond it by more than 2 %."""
    record, sketch = sketched(SliderCrank())
    guide, block = (shape for shape in sketch.shapes if shape.kind == "body")
    inner = guide.points[0, 1, :, 1].min()
    top, low = block.points[:, 0, :, 1].max(axis=1), block.points[:, 0, :, 1].min(axis=1)
    force = record.history[1, :, 2]
    pressed = force != 0.0
    assert pressed.any()
    np.testing.assert_allclose(np.where(force < 0.0, top, -low)[pressed], inner, rtol=0.02)
    assert max(top.max(), -low.min()) < 1.02 * inner


def test_the_beam_touches_its_sensors_where_it_is_pressed():
    """At 30 Hz its tip lies at a stop whenever a force is recorded."""
    record, sketch = sketched(ImpactBeam())
    beam = max((shape for shape in sketch.shapes if shape.kind == "line"), key=lambda shape: shape.width)
    tip, force = beam.points[:, 0, 1, 1], record.history[1, :, 2]
    pressed = np.abs(force) > 1.0
    assert pressed.any()
    np.testing.assert_allclose(np.abs(tip[pressed]), 0.13, rtol=0.1)
    check_it_fits(sketch)


@pytest.mark.parametrize("machine", [ImpactBeam(clearance=0.0), SliderCrank(slider_clearance=0.0)])
def test_a_gap_of_nothing_is_drawn(machine):
    """Nothing is divided by it."""
    _, sketch = sketched(machine)
    assert all(np.isfinite(shape.points).all() for shape in sketch.shapes)
