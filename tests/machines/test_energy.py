"""No energy from nothing: the balance of machines of modes, cycle by cycle, by a referee that shares no equation."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym import Drive, ModalMachine, Structure, simulate
from chaosgym.cli import app
from chaosgym.explore.point import view_of
from tests.machines.referee import Referee

TOLERANCE = 1e-8
"""Largest gap in a cycle's balance, as a share of the work and the losses that went through, each without its sign, and
of the energy stored."""

CYCLES = 3

MACHINES = 300
"""Random machines of the slow test, half of which strike."""


def drawn(seed):
    """A machine of one to five modes: rigid, nearly rigid, undamped, critical, equal, over six decades of frequency."""
    rng = np.random.default_rng([20261126, seed])
    count, speed = int(rng.integers(1, 6)), float(10.0 ** rng.uniform(0.0, 2.0))
    frequencies = speed * 10.0 ** rng.uniform(-4.0, 2.0, count)
    ratios = rng.choice([0.0, 0.01, 0.3, 1.0, 3.0], count)
    if rng.random() < 0.5 and count > 1:
        frequencies[0] = 0.0 if rng.random() < 0.6 else 1e-7 * frequencies.max()
    if rng.random() < 0.3:
        frequencies[:], ratios[:] = frequencies[-1] * (1.0 + 1e-9 * rng.standard_normal(count)), 1.0
    if rng.random() < 0.2:
        frequencies[:] = 0.0
    shapes = rng.uniform(0.3, 2.0, count) * rng.choice([-1.0, 1.0], count)
    gap = float(10.0 ** rng.uniform(-4.0, -2.0))
    # forces that cross the gap in about a cycle
    force = gap * speed**2 / float(shapes @ shapes) * 10.0 ** rng.uniform(0.0, 1.5)
    drives = [Drive.sine("force", rng.choice(["tip", "other"]), force, int(rng.integers(1, 4)), rng.uniform(0.0, 6.0))]
    if rng.random() < 0.3:
        drives.append(Drive.sampled("force", "tip", force * rng.uniform(-1.0, 2.0, 9), 3))
    if rng.random() < 0.3:
        drives.append(Drive.sine("displacement", "base", 2.0 * gap, 1))
    points = {"tip": shapes, "other": rng.standard_normal(count), "base": rng.standard_normal(count)}
    fastest = 2.0 * np.pi * max(frequencies.max(), speed)
    stiffness = fastest**2 / float(shapes @ shapes) * 10.0 ** rng.uniform(0.0, 2.0)
    return ModalMachine(
        modes=Structure.of_modes(frequencies, ratios, points),
        joint="tip",
        drives=tuple(drives),
        speed=speed,
        clearance=gap,
        offset=float(rng.choice([0.0, 0.5 * gap, -1.5 * gap])),
        stops=str(rng.choice(["one", "two"])),
        contact_stiffness=stiffness,
        contact_damping=float(rng.choice([0.0, 0.05, 1.0])) * np.sqrt(stiffness / float(shapes @ shapes)),
        lower_stiffness_factor=float(rng.choice([1.0, 0.2])),
        preload=float(rng.choice([0.0, 1.0, -3.0])) * force,
    )


def worst_gap(machine, cycles=CYCLES):
    """Largest gap in the balance of a cycle against what is allowed, and the impacts of all."""
    model = machine.reduce()
    referee, record = Referee(model), simulate(machine, cycles)
    states = [*record.section, record.final_state.coordinates]
    worst = 0.0
    for before, after in pairwise(states):
        stored, change = referee.energy(after), referee.energy(after) - referee.energy(before)
        balance = referee.cycle(before)[1]
        allowed = TOLERANCE * (balance.through + stored)
        worst = max(worst, abs(change - balance.work + balance.dissipated) / max(allowed, 1e-300))
    return worst, int(record.impacts.sum())


@pytest.mark.parametrize("seed", [*range(8), 255, 266])
def test_energy_comes_from_the_loads_alone(seed):
    """In every cycle the work of drive and preload is what is dissipated and the change of energy.

    In the last two a joint beyond a stop that would pull turns to press again.
    """
    assert worst_gap(drawn(seed))[0] < 1.0


@pytest.mark.slow
def test_energy_comes_from_the_loads_alone_in_many_machines():
    """The same of three hundred machines, whatever is slow, critical or equal in them, and half of which strike."""
    found = {seed: worst_gap(drawn(seed)) for seed in range(MACHINES)}
    assert sum(impacts > 0 for _, impacts in found.values()) > 0.4 * MACHINES
    assert {seed: gap for seed, (gap, _) in found.items() if not gap < 1.0} == {}


@pytest.mark.parametrize("share", [2e-6, 1e-5, 1e-4])
def test_a_slow_critical_mode_moves_as_a_free_body(share):
    """A body on a spring and a critical damper so soft that it would rest a kilometre away bounces as a free one."""
    of_slow, free = body(f"{40.0 * share}, 40 Hz"), body()
    shapes = {"tip": [2.0, 1.5], "base": [0.5, 0.1]}
    of_slow = replace(of_slow, modes=Structure.of_modes([40.0 * share, 40.0], [1.0, 0.0], shapes))
    records = simulate(of_slow, 3), simulate(free, 3)
    np.testing.assert_allclose(records[0].peak_force, records[1].peak_force, rtol=5.0 * share * 40.0)


def body(frequencies="0, 40 Hz", **fields):
    """A body that a constant force of 1 N presses on a stop, undamped: it bounces for ever."""
    rates = [float(text) for text in frequencies.removesuffix(" Hz").split(",")]
    given = {"preload": 1.0, "contact_damping": 0.0, "stops": "one", "contact_stiffness": 1e6, "speed": 10.0} | fields
    shapes = {"tip": [2.0, 1.5][: len(rates)], "base": [0.5, 0.1][: len(rates)]}
    modes = Structure.of_modes(rates, 0.0, shapes)
    return ModalMachine(modes=modes, joint="tip", clearance=1e-4, **given)


@pytest.mark.parametrize("frequencies", ["0, 40 Hz", "1e-8, 40 Hz", "1e-5, 40 Hz"])
def test_a_pressed_rigid_body_bounces_as_high_as_it_fell(frequencies):
    """Peaks of 15.1 N in every cycle, and the section of matrix exponentials and bisection, rigid or nearly so."""
    machine = body(frequencies)
    record, referee = simulate(machine, 5), Referee(machine.reduce())
    assert np.all(np.abs(record.peak_force[:, 0] - 15.15) < 0.02)
    for before, after in pairwise(record.section):
        end, _, peak, touches = referee.cycle(before)
        assert touches > 5
        np.testing.assert_allclose(after, end, rtol=0, atol=1e-9 * np.abs(end).max())
        assert 14.5 < peak < 15.16


def test_a_nearly_rigid_mode_is_said_to_be_one():
    """A mode below a millionth of the fastest counts as a rigid body, in the frequencies and in a note; 1e-3 Hz not."""
    machine = body("1e-5, 40 Hz")
    assert machine.natural_frequencies[0] == 0.0
    assert "1e-05 Hz" in machine.notes[0]
    assert body("1e-3, 40 Hz").natural_frequencies[0] == pytest.approx(1e-3)
    assert body("1e-3, 40 Hz").notes == ()
    assert "write 0 Hz" in body("0.02, 40 Hz", preload=100.0).notes[0]
    assert body("1e-3, 40 Hz", preload=0.0).notes == ()
    assert body("0, 40 Hz").notes == ()


@pytest.mark.parametrize("stops", ["one", "two"])
def test_a_mass_between_walls(stops):
    """A single motion of a rigid body, shaken, runs as by matrix exponentials and bisection."""
    machine = body("0 Hz", preload=0.0, stops=stops, drives=(Drive.sine("displacement", "base", 2e-3),))
    record, referee = simulate(machine, 3), Referee(machine.reduce())
    assert record.impacts.sum() > 3
    for before, after in pairwise(record.section):
        np.testing.assert_allclose(after, referee.cycle(before)[0], rtol=1e-7)


def test_equal_critically_damped_modes():
    """Eight modes of 31.67 Hz within 1e-9, critically damped: the impacts and the section of the referee."""
    rng = np.random.default_rng(509)
    frequencies = 31.66595785 * (1.0 + 1e-9 * rng.uniform(-1.0, 1.0, 8))
    shapes = {"tip": rng.uniform(0.3, 1.5, 8)}
    machine = ModalMachine(
        modes=Structure.of_modes(frequencies, 1.0, shapes),
        joint="tip",
        drives=(Drive.sine("force", "tip", 20.0),),
        speed=15.0,
        clearance=1e-4,
        contact_stiffness=1e6,
        contact_damping=1.9e3,
    )
    record, referee = simulate(machine, 4), Referee(machine.reduce())
    assert record.impacts.sum() > 0
    for cycle, (before, after) in enumerate(pairwise(record.section)):
        end, _, peak, touches = referee.cycle(before)
        assert touches == record.impacts[cycle].sum()
        np.testing.assert_allclose(after, end, rtol=0, atol=1e-5 * np.abs(end).max())
        assert record.peak_force[cycle].max() == pytest.approx(peak, rel=0.02)


BALL = """
title = "ball in a shaken box"
[structure]
frequencies = "0 Hz"
damping_ratios = "0 %"
[structure.shapes]
ball = "1 kg^-1/2"
base = "1 kg^1/2"
[joint]
at = "ball"
clearance = "22 mm"
stiffness = "0.1 N/um"
damping = "0 N s/m"
[[drive]]
displacement = "30 mm"
[operation]
speed = "2 Hz"
speed_range = "1 to 5 Hz"
clearance_range = "10 to 40 mm"
"""


@pytest.mark.parametrize(
    "command",
    [
        "show ball.toml",
        "simulate ball.toml --cycles 4",
        "diagnose ball.toml --budget 100",
        "sweep ball.toml --axis speed=2:3:2 --budget 100 --out sweep",
        "classify ball.toml",
        "design --template ball.toml",
    ],
)
def test_every_command_takes_a_machine_that_is_a_rigid_body_alone(command, tmp_path, monkeypatch):
    """A ball between the walls of a shaken box: no spring, no damper, and an answer by every command."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.toml").write_text(BALL)
    result = CliRunner().invoke(app, command.split(), catch_exceptions=False)
    assert result.exit_code == 0, result.output


def test_the_page_of_a_rigid_body():
    """What the sliders of ``explore`` draw: peaks and verdict of the ball."""
    view = view_of(body("0 Hz", preload=0.0, stops="two", drives=(Drive.sine("displacement", "base", 2e-3),)))
    assert view.headline != "can't be followed"
    assert view.peaks.max() > 0.0
