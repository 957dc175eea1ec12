"""Pictures of machines are true: rigid parts keep their lengths, gaps are drawn as large as told, all of it fits."""

import re

import numpy as np
import pytest

from chaosgym import ImpactBeam, SliderCrank, read_machine, simulate
from chaosgym.machines import MACHINES
from chaosgym.machines.machine_file import template
from chaosgym.machines.mechanism.picture import link_lines

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


def test_a_spring_and_a_damper_are_drawn_between_their_points(tmp_path):
    """The spring as a zigzag, the damper as a straight line, from the shaft to the slider at every moment."""
    spring = 'between = ["ground.shaft", "slider.wrist"]\nstiffness = "2 kN/m"\nfree_length = "150 mm"\n'
    damper = 'between = ["ground.shaft", "slider.wrist"]\ndamping = "2 N s/m"\n'
    text = template("slider-crank").replace("[operation]", f"[[spring]]\n{spring}[[damper]]\n{damper}[operation]")
    (tmp_path / "sprung.toml").write_text(text)
    machine = read_machine(tmp_path / "sprung.toml")
    _, sketch = sketched(machine)
    coil, dashpot = (shape.points[:, 0] for shape in sketch.shapes if shape.points.shape[2] == 10)
    slider = link_lines(machine, machine.nominal_places(np.arange(SAMPLES) * (2.0 * np.pi / SAMPLES)))["slider"][:, 0]
    for line in (coil, dashpot):
        np.testing.assert_allclose(line[:, 0], 0.0, atol=1e-12)
        np.testing.assert_allclose(line[:, -1], slider, atol=1e-9)
    lengths = [np.linalg.norm(np.diff(line, axis=1), axis=-1).sum(axis=1) for line in (coil, dashpot)]
    np.testing.assert_allclose(lengths[1], np.linalg.norm(slider, axis=1), rtol=1e-9)
    assert np.all(lengths[0] > 1.05 * lengths[1])
    check_it_fits(sketch)


def test_joints_of_a_structure_are_drawn_between_their_stops():
    """Each joint of the pipe moves as told: its block touches a stop where its displacement reaches it."""
    record, sketch = sketched(MACHINES["docs/machines/pipe-in-two-supports.toml"]())
    blocks = [shape for shape in sketch.shapes if shape.kind == "body" and len(shape.points) == SAMPLES]
    stops = [shape.points[0, 0, :, 1] for shape in sketch.shapes if shape.colour is None]
    told = [words.text[0] for words in sketch.words if "drawn" in words.text[0]]
    for j, block in enumerate(blocks):
        times = float(re.search(r"drawn ([\d,]+) times", told[j])[1].replace(",", ""))
        motion = record.histories[-1, :, 3 * j]
        upper, lower = record.machine.stops[j]
        from_stop = stops[2 * j].min() - block.points[:, 0, :, 1].max(axis=1)
        np.testing.assert_allclose(from_stop, times * (upper - motion), rtol=1e-9, atol=1e-9)
        from_stop = block.points[:, 0, :, 1].min(axis=1) - stops[2 * j + 1].max()
        np.testing.assert_allclose(from_stop, times * (motion - lower), rtol=1e-9, atol=1e-9)
    assert [text.splitlines()[1] for text in told] == ["half the play 0.15 mm", "half the play 0.25 mm"]
    check_it_fits(sketch)


@pytest.mark.parametrize("name", ["moon-shaw-1983", "friction-damper", "kahraman-singh-1990", "motor-with-backlash"])
def test_every_kind_of_joint_of_a_structure_is_drawn(name):
    """One stop, friction, varying stiffness, and what turns: all that is drawn fits, with a force at each stop."""
    machine = MACHINES[f"docs/machines/{name}.toml"]()
    _, sketch = sketched(machine)
    check_it_fits(sketch)
    stops = sum(np.isfinite(machine.room_of()))
    assert sum("N" in words.text[0].split() for words in sketch.words) == stops
