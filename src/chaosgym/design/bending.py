r"""Bending fatigue of the flexible part: stress at a section, rainflow counting, S-N line, Palmgren-Miner.

The stress at the outer fibre is a sum over the modes, s = K_f (E c sum_i phi_i'' q_i) + s_0, with the notch factor K_f
and what is there without any vibration, s_0. Each of its cycles, of amplitude s_a about the mean s_m, counts as a
reversed one of amplitude s_ar, and takes a share of the life by the line of Basquin through (s_D, N_D) with slope k:

    Goodman    s_ar = s_a / (1 - s_m / S_u)
    Gerber     s_ar = s_a / (1 - (s_m / S_u)^2)
    Basquin    N = N_D (s_D / s_ar)^k
    Miner      1 / L = sum of 1 / N over the cycles of the history

Means below zero are taken as zero. There is no endurance limit: the line goes on. Both
outer fibres are counted, and the worse one is told.

References
----------
R. G. Budynas, J. K. Nisbett, Shigley's Mechanical Engineering Design, 9th ed., sections 6-8, 6-10, 6-12 and 6-15.
E. Haibach, Betriebsfestigkeit, 3rd ed. (2006): Miner's rule with the line of Basquin extended.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.design.bearing import hours_of
from chaosgym.design.fatigue import rainflow_means
from chaosgym.design.runs import SettledRun
from chaosgym.design.told import hours_told
from chaosgym.errors import DesignError, ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameter, parameters_of, validate
from chaosgym.simulation import parallel_map, simulate
from chaosgym.simulation.modal_history import modal_history

Array = NDArray[np.float64]

CYCLES = 32
"""Operating cycles of a settled response over which stresses are counted."""

SAMPLES, MOST_SAMPLES = 2880, 46_080
"""Samples of a cycle, doubled until the modal coordinates miss by less than ``MISS``, at the most."""

MISS = 0.01
"""Share of the largest modal coordinate by which a cycle's end may miss the exact one."""

LEAST_CYCLES = 1e3
"""Stress cycles below which a part yields, so that no line of Basquin holds (Shigley, 6-8)."""

MEANS = ("goodman", "gerber", "none")


class Section(NamedTuple):
    """Where a part bends; one of three.

    Attributes
    ----------
    at
        Position [m] on the machine's own beam, from its pivot on; with ``link`` on that link, from its start on.
    link
        Name of a link of a mechanism that bends.
    turn, span
        Turn of one point against another, such as "turn2 - turn1", over the distance [m] between them.
    curvatures
        Modal curvatures phi'' [kg^-1/2 m^-2], of each mode.
    """

    at: float | None = None
    link: str = ""
    turn: str = ""
    span: float = 0.0
    curvatures: tuple[float, ...] = ()

    @property
    def told(self) -> str:
        """Which one it is, for people."""
        if self.at is not None:
            return f"at {1e3 * self.at:g} mm" + (f" of {self.link}" if self.link else "")
        return f"by the turn {self.turn}" if self.turn else "by the modal curvatures that are stated"


def _assumed(default: Any, **about: Any) -> Any:
    return parameter(default, provenance="assumed", **about)


@dataclass(frozen=True, kw_only=True)
class Bending:
    """Data of a section and of its material, in SI units.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range.
    """

    section: Section
    amplitude: float = _assumed(2.5e8, unit="Pa", low=1e3, high=1e11, source="an example")
    """Reversed stress [Pa] that the part bears for ``cycles``; s_D."""
    cycles: float = _assumed(1.0, unit="Mcycles", low=1e-3, high=1e4, source="an example")
    """Stress cycles [10^6]; N_D."""
    slope: float = _assumed(5.0, low=1.0, high=50.0, source="an example")
    """Slope k of the S-N line."""
    ultimate: float = _assumed(6e8, unit="Pa", low=1e3, high=1e11, source="an example")
    """Ultimate tensile strength S_u [Pa]."""
    mean_stress: str = _assumed("goodman", choices=MEANS, source="the safer one of two")
    """How the mean stress counts."""
    notch_factor: float = _assumed(1.0, low=1.0, high=20.0, source="no notch")
    """Fatigue notch factor K_f, which multiplies the stress."""
    static_stress: float = _assumed(0.0, unit="Pa", low=-1e11, high=1e11, source="none")
    """Stress s_0 [Pa] that is there without any vibration, pull above zero."""
    uncertainty: float = _assumed(3.0, low=1.0, high=1e3, source="scatter of lives at one stress, Haibach")
    """Factor to which lives are known."""
    fibre: float = _assumed(0.0, unit="m", low=0.0, high=10.0, source="of the machine's own beam")
    """Distance c [m] of the outer fibre from the neutral one."""
    modulus: float = _assumed(0.0, unit="Pa", low=0.0, high=1e13, source="of the machine's own beam")
    """Young's modulus E [Pa]."""

    def __post_init__(self) -> None:
        validate(self)

    def cycles_at(self, reversed_amplitude: ArrayLike) -> Array:
        """Stress cycles that a reversed amplitude [Pa] takes, infinite for none.

        Examples
        --------
        >>> one = Bending(section=Section(at=0.1), amplitude=2e8, cycles=1.0, slope=5.0)
        >>> one.cycles_at([2e8, 4e8, 0.0]).tolist()
        [1000000.0, 31250.0, inf]
        """
        with np.errstate(divide="ignore", over="ignore"):
            return np.asarray(1e6 * self.cycles * (self.amplitude / np.asarray(reversed_amplitude)) ** self.slope)

    def reversed_amplitudes(self, amplitude: ArrayLike, mean: ArrayLike) -> Array:
        """Amplitudes [Pa] that about a mean of zero do the same damage; infinite from the ultimate strength on."""
        share = np.maximum(np.asarray(mean, dtype=float), 0.0) / self.ultimate
        left = {"goodman": 1.0 - share, "gerber": 1.0 - share**2, "none": np.ones_like(share)}[self.mean_stress]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(left > 0.0, np.asarray(amplitude) / left, np.inf)


def stress_of_modes(machine: Machine, bending: Bending) -> Array:
    """Stress (n,) [Pa kg^-1/2 m^-1] at the upper fibre of a section for each mode, without notch.

    Raises
    ------
    ParameterError
        If there is no such section on the machine.

    Examples
    --------
    >>> from chaosgym.design.bending import Bending, Section, stress_of_modes
    >>> stress_of_modes(chaosgym.ImpactBeam(), Bending(section=Section(at=0.1))).shape
    (6,)
    """
    section = bending.section
    if section.at is not None:
        try:
            return machine.stress_at(section.at)
        except ParameterError as error:
            raise ParameterError(f"bending.at: {error}") from None
    if machine.flexible is None:
        kind = "modes or matrices, of constant stiffness and without friction"
        raise ParameterError(f"[bending] is for a machine of {kind}; {machine.name} is none")
    bent = np.array(section.curvatures)
    if section.turn:
        try:
            bent = machine.shape_of(section.turn) / section.span
        except ParameterError as error:
            raise ParameterError(f"bending.turn: {error}") from None
    modes = len(machine.flexible.stiffness)
    if len(bent) != modes:
        raise ParameterError(f"bending.curvatures has {len(bent)} entries; allowed: {modes}, one a mode")
    return -bending.modulus * bending.fibre * bent


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
    >>> from chaosgym.design.bending import Bending, Section, stressed
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
class BendingLife:
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
        lives = (hours_told(hours_of(life, cycle_period)) for life in (self.lives[0], self.worst))
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
        own = {name: value if math.isfinite(value) else None for name, value in self.nominal._asdict().items()}
        return {
            "section": {**self.bending.section._asdict(), "curvatures": list(self.bending.section.curvatures)},
            "material": {name: getattr(self.bending, name) for name in parameters_of(self.bending)},
            "nominal": own,
            "lives": [life if math.isfinite(life) else None for life in self.lives],
            "assured": self.assured if math.isfinite(self.assured) else None,
        }


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
    >>> from chaosgym.design.bending import Bending, Section, bending_life
    >>> found = assess(chaosgym.ImpactBeam(excitation_frequency=12.0), series_size=4)
    >>> len(bending_life([found.nominal], Bending(section=Section(at=0.1))).lives)
    1
    """
    found = parallel_map(lambda run: _of_run(run, bending), runs, workers=workers)
    return BendingLife(bending, found[0], tuple(one.life for one in found))


def fibres(machine: Machine, bending: Bending) -> Array:
    """Stress (2, n) [Pa] at both outer fibres for each coordinate of a mechanism or each mode, without notch.

    Raises
    ------
    ParameterError
        If there is no such section on the machine.

    Examples
    --------
    >>> from chaosgym.design.bending import Bending, Section, fibres
    >>> upper, lower = fibres(chaosgym.ImpactBeam(), Bending(section=Section(at=0.1)))
    >>> bool(np.all(upper == -lower))
    True
    """
    section = bending.section
    if section.link and section.at is not None:
        try:
            return machine.fibre_stress(section.link, section.at, bending.fibre)
        except ParameterError as error:
            raise ParameterError(f"bending: {error}") from None
    row = stress_of_modes(machine, bending)
    return np.stack([row, -row])


def _of_link(run: SettledRun, bending: Bending) -> Stressed:
    """Of a section of a mechanism's link, whose kernel shows the stress itself."""
    found = []
    for row in fibres(run.machine, bending):
        shown = simulate(run.machine.showing(row), CYCLES, run.final_state, samples_per_cycle=SAMPLES).history
        assert shown is not None
        history = bending.notch_factor * shown[:, :, 0].ravel() + bending.static_stress
        found.append(stressed(history, CYCLES, bending))
    return min(found, key=lambda one: one.life)


def _of_run(run: SettledRun, bending: Bending) -> Stressed:
    if bending.section.link:
        return _of_link(run, bending)
    rows, samples = stress_of_modes(run.machine, bending), SAMPLES
    while True:
        record = simulate(run.machine, CYCLES, run.final_state, samples_per_cycle=samples)
        modes = modal_history(record, rows)
        if modes.miss <= MISS or samples >= MOST_SAMPLES:
            break
        samples *= 2
    bent = bending.notch_factor * modes.shown.ravel()
    both = [stressed(side * bent + bending.static_stress, CYCLES, bending, modes.miss) for side in (1.0, -1.0)]
    return min(both, key=lambda one: one.life)


REQUIRED = ("amplitude", "cycles", "slope")
"""What an S-N line is."""


def read_bending(values: Mapping[str, Any], machine: Machine) -> Bending:
    """Bending of a brief, in SI: an S-N line, a section of one of three kinds, and what the section's kind needs.

    Raises
    ------
    DesignError
        If something is missing.
    ParameterError
        If a value is out of its range, or the section is none of the machine.

    Examples
    --------
    >>> from chaosgym.design.bending import read_bending
    >>> line = {"amplitude": 2.5e8, "cycles": 1.0, "slope": 5.0, "ultimate": 6e8}
    >>> read_bending({"at": 0.1, **line}, chaosgym.ImpactBeam()).section.told
    'at 100 mm'
    """
    given = dict(values)
    for name in REQUIRED:
        if name not in given:
            raise DesignError(f"[bending] lacks {name}: an S-N line is an amplitude at so many cycles, and a slope")
    kinds = [name for name in ("at", "turn", "curvatures") if name in given]
    if len(kinds) != 1:
        raise DesignError(
            f"[bending] has {' and '.join(kinds) or 'no section'}; allowed: one of at, turn (with span), curvatures"
        )
    on_link = "link" in given
    if kinds == ["at"] and not on_link and machine.bending_links:
        raise DesignError(f"[bending] lacks link, the one that bends; allowed: {', '.join(machine.bending_links)}")
    if on_link and kinds != ["at"]:
        raise DesignError("[bending] has link, which goes with at, the place of the section on it")
    if given.get("mean_stress", "goodman") != "none" and "ultimate" not in given:
        raise DesignError('[bending] lacks ultimate, the tensile strength; or say mean_stress = "none"')
    needed = {"at": ("fibre",) if on_link else (), "turn": ("fibre", "modulus", "span")}
    for name in needed.get(kinds[0], ("fibre", "modulus")):
        if name not in given:
            raise DesignError(f"[bending] lacks {name}")
        if not given[name] > 0.0:
            raise ParameterError(f"bending.{name} = {given[name]:g} is out of range; allowed: above 0")
    goes_with = {"fibre": "turn, curvatures or link", "modulus": "turn or curvatures", "span": "turn"}
    for name in needed.get(kinds[0], ("fibre", "modulus")):
        goes_with.pop(name)
    for name, what in goes_with.items():
        if name in given:
            raise DesignError(f"[bending] has {name}, which goes with {what}")
    section = Section(**{name: given.pop(name) for name in Section._fields if name in given})
    bending = Bending(section=section, **given)
    if not fibres(machine, bending).any():
        raise ParameterError(f"[bending]: no mode bends the section {section.told}")
    return bending
