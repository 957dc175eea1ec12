"""Random machines with gaps, and their motions by another way: long runs from energy shells, sorted by what repeats."""

import math
from typing import NamedTuple

import numpy as np

import chaosgym
from chaosgym.machines.modal_machine import Joint, machine_with_joints
from chaosgym.simulation.parallel import parallel_map
from tests.branches.test_branch import oscillator

RUN_ON, SEEN = (250, 1000, 4000), 256
"""Cycles that a start runs before it is looked at, again and again where it does not repeat, and cycles looked at."""

SMALL_SHARE = 0.05
"""Share of the starts below which a motion does not count."""


class Motion(NamedTuple):
    """What some starts settle on: its period, 0 if it does not repeat; the largest force [N]; share of the starts."""

    period: int
    peak: float
    share: float


RATIO = 1.0 / (2.0 * math.pi)


def trilinear(ratio):
    """Between elastic stops five times as stiff as the spring, damping 4 %, at a multiple of its natural frequency."""
    return oscillator(damping=0.04, stiffness=5.0, speed=ratio * RATIO, force=0.4)


def soft_stop(ratio):
    """One stop 29 times as stiff as the spring, damping 1 %, turned by an unbalance that grows with the square."""
    return oscillator(
        damping=0.01,
        stiffness=29.0,
        stops="one",
        gap=1.26,
        speed=ratio * RATIO,
        force=0.7 * ratio**2,
        angle=math.pi / 2.0,
    )


def random_machine(seed):
    """A machine of one to three modes with one gap, whose drive nearly reaches a stop or reaches it."""
    random = np.random.default_rng([2024, seed])
    modes = int(random.integers(1, 4))
    frequencies = np.sort(random.uniform(1.0, 6.0, modes))
    frequencies[0] = 1.0
    shape = random.uniform(0.4, 1.5, modes) * random.choice([-1.0, 1.0], modes)
    structure = chaosgym.Structure.of_modes(
        frequencies.tolist(), random.uniform(0.01, 0.06, modes).tolist(), {"tip": shape.tolist()}
    )
    gap = 1e-3
    rates = 2.0 * np.pi * frequencies
    stiffness = float(10.0 ** random.uniform(0.3, 2.0) / np.sum(shape**2 / rates**2))
    speed = float(random.uniform(0.6, 2.2))
    response = shape**2 / np.hypot(rates**2 - (2.0 * np.pi * speed) ** 2, 0.05 * rates * 2.0 * np.pi * speed)
    force = gap * float(random.uniform(0.3, 1.5)) / float(np.sum(response))
    return chaosgym.ModalMachine(
        modes=structure,
        joint="tip",
        drives=(chaosgym.Drive.sine("force", "tip", force),),
        speed=speed,
        clearance=gap,
        stops=str(random.choice(["one", "two"])),
        contact_stiffness=stiffness,
        contact_damping=0.0,
    )


def harder_machine(seed, *family):
    """Two to four modes, one or two joints, hard stops, offset gaps and two harmonics."""
    random = np.random.default_rng([77, *family, seed])
    modes, joints = int(random.integers(2, 5)), int(random.integers(1, 3))
    frequencies = np.sort(random.uniform(0.8, 9.0, modes))
    names = [f"j{number}" for number in range(joints)]
    shapes = {name: random.uniform(0.2, 1.5, modes) * random.choice([-1.0, 1.0], modes) for name in (*names, "drive")}
    structure = chaosgym.Structure.of_modes(
        frequencies.tolist(), random.uniform(0.003, 0.03, modes).tolist(), {k: v.tolist() for k, v in shapes.items()}
    )
    rates, speed = 2.0 * np.pi * frequencies, float(random.uniform(0.4, 1.6) * frequencies[0])
    drive = shapes["drive"]
    force = (
        1e-3
        * float(random.uniform(0.5, 2.0))
        / float(
            np.sum(
                np.abs(drive * shapes["j0"])
                / np.hypot(rates**2 - (2.0 * np.pi * speed) ** 2, 0.04 * rates * speed * 6.3)
            )
        )
    )
    drives = (
        chaosgym.Drive.sine("force", "drive", force),
        chaosgym.Drive.sine("force", "drive", 0.4 * force, harmonic=2),
    )
    stops = [
        Joint(
            name,
            float(10.0 ** random.uniform(-3.3, -2.7)),
            float(10.0 ** random.uniform(1.0, 3.0) / np.sum(shapes[name] ** 2 / rates**2)),
            0.0,
            stops=str(random.choice(["one", "two"])),
            offset=float(random.uniform(-2e-4, 2e-4)),
        )
        for name in names
    ]
    return machine_with_joints(structure, dict(zip(names, stops, strict=True)), drives)(speed=speed)


FRESH = 5001
"""Family that was drawn after the search had its present form."""


def fresh_machine(seed):
    """As ``harder_machine``, of the fresh family."""
    return harder_machine(seed, FRESH)


def fresh_shells(machine, count, seed):
    """As ``energy_shells``, of the fresh family."""
    return energy_shells(machine, count, seed, FRESH)


def rotated_machine(seed):
    """One to three modes whose shapes are random directions, a gap anywhere, stops with or without a damper."""
    random = np.random.default_rng([630063, seed, 0])
    modes = int(random.integers(1, 4))
    frequencies = np.cumsum([1.0, *(random.exponential(1.3, modes - 1) + 0.25)])
    ratios = np.exp(random.uniform(math.log(0.004), math.log(0.06), modes))
    shapes = {name: random.standard_normal(modes) for name in ("gap", "motor")}
    shapes = {name: shape / np.linalg.norm(shape) for name, shape in shapes.items()}
    shapes["gap"][0] = math.copysign(max(abs(shapes["gap"][0]), 0.3), shapes["gap"][0])
    structure = chaosgym.Structure.of_modes(
        frequencies.tolist(), ratios.tolist(), {name: shape.tolist() for name, shape in shapes.items()}
    )
    rates = 2.0 * np.pi * frequencies
    speed = float(
        frequencies[int(random.integers(0, min(modes, 2)))] * math.exp(random.uniform(math.log(0.55), math.log(2.0)))
    )
    gap = math.exp(random.uniform(math.log(3e-4), math.log(3e-3)))
    rate = 2.0 * math.pi * speed
    response = shapes["motor"] * shapes["gap"] / (rates**2 - rate**2 + 2j * ratios * rates * rate)
    force = gap * math.exp(random.uniform(math.log(0.2), math.log(2.0))) / float(abs(np.sum(response)))
    stiffness = float(10.0 ** random.uniform(-0.3, 2.2) / np.sum(shapes["gap"] ** 2 / rates**2))
    damping = float(random.choice([0.0, 1.0]) * 2.0 * random.uniform(0.0, 0.1) * math.sqrt(stiffness))
    joint = Joint("gap", gap, stiffness, damping, stops=str(random.choice(["one", "two"])))
    return machine_with_joints(structure, {"gap": joint}, (chaosgym.Drive.sine("force", "motor", force),))(speed=speed)


def normal_states(machine, count, seed):
    """Normally distributed states with the same mean energy in every mode; the joint moves 1.5 gaps in the mean."""
    random = np.random.default_rng([631, seed])
    rates = np.sqrt(machine.flexible.stiffness)
    gap = max(gap / np.sqrt(np.sum((shape / rates) ** 2)) for shape, gap in machine.kinematics.stops)
    return 1.5 * gap * random.standard_normal((count, 2 * len(rates))) / np.concatenate([rates, np.ones(len(rates))])


def energy_shells(machine, count, seed, *family):
    """States of equal energy within each of many shells, up to four times what brings the tip to a stop."""
    random = np.random.default_rng([7, *family, seed])
    flexible = machine.flexible
    rates = np.sqrt(flexible.stiffness)
    gaps = [gap / np.sqrt(np.sum((shape / rates) ** 2)) for shape, gap in machine.kinematics.stops]
    least = max(gaps)
    sizes = 4.0 * least * np.arange(1, count + 1) / count
    directions = random.standard_normal((count, 2 * len(rates)))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return sizes[:, None] * directions / np.concatenate([rates, np.ones(len(rates))])


def motions_of(machine, starts, workers=None):
    """Motions that some starts settle on, by long runs."""
    seen = parallel_map(lambda start: _settled(machine, start), starts, workers=workers)
    groups = []
    for period, peak in seen:
        for group in groups:
            if group[0] == period and (period == 0 or abs(group[1] - peak) <= 1e-3 * max(peak, 1e-12)):
                group[2] += 1
                break
        else:
            groups.append([period, peak, 1])
    return [Motion(period, peak, count / len(starts)) for period, peak, count in groups]


def _settled(machine, start):
    state = start
    for cycles in RUN_ON:
        record = chaosgym.simulate(machine, SEEN, state, transient=cycles)
        path = np.vstack([record.section, record.final_state.coordinates])
        size = np.abs(path).max(axis=0)
        misses = [np.max(np.abs(path[period:] - path[:-period]) / size) for period in range(1, SEEN // 2)]
        if min(misses) < 1e-6:
            return 1 + int(np.argmax(np.array(misses) < 1e-3)), float(record.peak_force.max())
        state = record.final_state
    return 0, float(record.peak_force.max())


def other_motions(machine, starts, workers=None):
    """Those that count, if there are several."""
    found = [one for one in motions_of(machine, starts, workers) if one.share > SMALL_SHARE]
    return found if len(found) > 1 else []


def is_among(motion, attractors):
    """Whether a search met a motion."""
    for one in attractors.motions:
        if motion.period == 0 and one.period is None and one.nature != "periodic":
            return True
        if one.period == motion.period and abs(one.largest_peak - motion.peak) <= 1e-3 * max(motion.peak, 1e-9):
            return True
    return False
