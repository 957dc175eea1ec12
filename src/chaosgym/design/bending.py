"""Bending fatigue of the flexible part: stress history of a section, rainflow counting, Palmgren-Miner.

The stress at the outer fibre is a sum over the modes, s = K_f (E c sum_i phi_i'' q_i) + s_0, with the notch factor K_f
and what is there without any vibration, s_0. Its cycles take shares of the life (``bent_section``), and
1 / L = sum of 1 / N over the cycles of the history. Both outer fibres are counted, and the worse one is told.

References
----------
E. Haibach, Betriebsfestigkeit, 3rd ed. (2006): Miner's rule with the line of Basquin extended.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.design.bearing import hours_of
from chaosgym.design.bent_section import Bending, fibres
from chaosgym.design.fatigue import rainflow_means
from chaosgym.design.runs import SettledRun
from chaosgym.design.texts import hours_text
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.plain import Result
from chaosgym.simulation import simulate
from chaosgym.simulation.modal_history import modal_history
from chaosgym.simulation.parallel import parallel_map

CYCLES = 32
"""Operating cycles of a settled response over which stresses are counted."""

SAMPLES, MOST_SAMPLES = 2880, 46_080
"""Samples of a cycle, doubled until the modal coordinates miss by less than ``MISS``, at the most."""

MISS = 0.01
"""Share of the largest modal coordinate by which a cycle's end may miss the exact one."""

LEAST_CYCLES = 1e3
"""Stress cycles below which a part yields, so that no line of Basquin holds (Shigley, 6-8)."""


class Stressed(NamedTuple):
    """Stress history of a section of one machine.

    Attributes
    ----------
    lowest, highest
        Stress at the worse fibre [Pa], notch included.
    equivalent
        Reversed amplitude [Pa] that does the same damage once an operating cycle.
    life
        [10^6 operating cycles]; infinite without stress.
    severest
        Stress cycles that the largest amplitude alone would take.
    miss
        Share of the largest modal coordinate by which the stress may be off.
    """

    lowest: float
    highest: float
    equivalent: float
    life: float
    severest: float
    miss: float


def stressed(history: ArrayLike, cycles: int, bending: Bending, miss: float = 0.0) -> Stressed:
    """Life of a fibre under a stress history that repeats.

    Parameters
    ----------
    history : (samples,)
        Stress [Pa], notch included.
    cycles
        Operating cycles that it covers.
    bending
        Material.
    miss
        Handed on.

    Examples
    --------
    >>> from chaosgym.design.bending import stressed
    >>> from chaosgym.design.bent_section import Bending, Section
    >>> line = Bending(section=Section(at=0.1), amplitude=2.5e8, cycles=1.0, slope=5.0, mean_stress="none")
    >>> stressed([0.0, 2.5e8, 0.0, -2.5e8], cycles=1, bending=line).life
    1.0
    """
    values = np.asarray(history, dtype=float)
    ranges, means, counts = rainflow_means(values)
    reversed_ = bending.reversed_amplitudes(0.5 * ranges, means)
    if bending.mean_stress != "none" and values.max() >= bending.ultimate:
        reversed_ = np.append(reversed_, np.inf)
        counts = np.append(counts, 1.0)
    taken = bending.cycles_at(reversed_)
    damage = float(np.sum(counts / np.maximum(taken, 1e-300))) / cycles
    life = 1e-6 / damage if damage > 0.0 else math.inf
    equivalent = bending.amplitude * (bending.cycles / life) ** (1.0 / bending.slope) if life > 0.0 else math.inf
    severest = float(taken.min(initial=math.inf))
    return Stressed(float(values.min()), float(values.max()), equivalent, life, severest, miss)


@dataclass(frozen=True)
class BendingLife(Result):
    """How long a section lasts.

    Attributes
    ----------
    bending
        What was asked.
    nominal
        What the nominal machine's section goes through.
    lives
        Life [10^6 operating cycles] of the nominal machine's section, then of each machine of the series.
    """

    shows = "section=bending.section nominal lives assured"

    bending: Bending
    nominal: Stressed
    lives: tuple[float, ...]

    @property
    def worst(self) -> float:
        """Shortest life [10^6 operating cycles] of all machines."""
        return min(self.lives)

    @property
    def assured(self) -> float:
        """That life over the factor to which lives are known."""
        return self.worst / self.bending.uncertainty

    def told(self, cycle_period: float) -> list[str]:
        """Lines for people; the period of a cycle in s."""
        own, asked = self.nominal, self.bending
        lives = (hours_text(hours_of(life, cycle_period)) for life in (self.lives[0], self.worst))
        lines = [
            f"bending {asked.section.told}: {1e-6 * own.lowest:.4g} to {1e-6 * own.highest:.4g} MPa, equivalent "
            f"amplitude {1e-6 * own.equivalent:.4g} MPa a cycle",
            "bending life {}, {} of the worst of {} machines, each known to a factor of {:g}".format(
                *lives, len(self.lives), asked.uncertainty
            ),
        ]
        if own.severest < LEAST_CYCLES:
            lines.append("the section yields: below a thousand stress cycles no S-N line holds")
        if own.miss > MISS:
            lines.append(
                f"the stress is known to {own.miss:.0%} only: the contact is too stiff for {MOST_SAMPLES} samples"
            )
        return lines

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; None stands for a life without end."""
        material = {name: getattr(self.bending, name) for name in parameters_of(self.bending)}
        return {**super().as_dict(), "material": material}


def bending_life(runs: Sequence[SettledRun], bending: Bending, *, workers: int | None = None) -> BendingLife:
    """Life of a section of settled machines.

    Parameters
    ----------
    runs
        The nominal machine, then others of its tolerances.
    bending
        Section and material.
    workers
        Number of threads; all processors by default.

    Raises
    ------
    ParameterError
        If there is no such section on a machine.
    SimulationError
        If a run can't be finished.

    Examples
    --------
    >>> from chaosgym.design import assess
    >>> from chaosgym.design.bending import bending_life
    >>> from chaosgym.design.bent_section import Bending, Section
    >>> found = assess(chaosgym.ImpactBeam(excitation_frequency=12.0), series_size=4)
    >>> len(bending_life([found.nominal], Bending(section=Section(at=0.1))).lives)
    1
    """
    found = parallel_map(lambda run: _of_run(run, bending), runs, workers=workers)
    return BendingLife(bending, found[0], tuple(one.life for one in found))


def _of_run(run: SettledRun, bending: Bending) -> Stressed:
    part = run.machine.bending_parts.get(bending.section.link)
    if part is not None and part.showing is not None:
        return _of_link(run, bending, part.showing)
    row, samples = fibres(run.machine, bending)[0], SAMPLES
    while True:
        record = simulate(run.machine, CYCLES, run.final_state, samples_per_cycle=samples)
        modes = modal_history(record, row)
        if modes.miss <= MISS or samples >= MOST_SAMPLES:
            break
        samples *= 2
    bent = bending.notch_factor * modes.shown.ravel()
    both = [stressed(side * bent + bending.static_stress, CYCLES, bending, modes.miss) for side in (1.0, -1.0)]
    return min(both, key=lambda one: one.life)


def _of_link(run: SettledRun, bending: Bending, showing: Callable[[Array], Machine]) -> Stressed:
    """Of a section of a mechanism's link, whose kernel shows the stress itself."""
    found = []
    for row in fibres(run.machine, bending):
        shown = simulate(showing(row), CYCLES, run.final_state, samples_per_cycle=SAMPLES).history
        assert shown is not None
        history = bending.notch_factor * shown[:, :, 0].ravel() + bending.static_stress
        found.append(stressed(history, CYCLES, bending))
    return min(found, key=lambda one: one.life)
