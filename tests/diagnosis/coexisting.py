"""Random machines with gaps, and their motions by another way: long runs from energy shells, sorted by what repeats."""

from typing import NamedTuple

import numpy as np

import chaosgym
from chaosgym.simulation import parallel_map

RUN_ON, SEEN = (250, 1000, 4000), 64
"""Cycles that a start runs before it is looked at, again and again where it does not repeat, and cycles looked at."""

SMALL_SHARE = 0.05
"""Share of the starts below which a motion does not count."""


class Motion(NamedTuple):
    """What some starts settle on: its period, 0 if it does not repeat; the largest force [N]; share of the starts."""

    period: int
    peak: float
    share: float


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


def energy_shells(machine, count, seed):
    """States of equal energy within each of many shells, up to four times what brings the tip to a stop."""
    random = np.random.default_rng([7, seed])
    flexible = machine.flexible
    rates = np.sqrt(flexible.stiffness)
    (shape,) = flexible.joints
    least = machine.clearance / np.sqrt(np.sum((shape / rates) ** 2))
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
