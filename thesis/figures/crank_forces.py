"""The slider's peak force against the machine's parameters. Figures 4.13, 4.14, 4.16 and 4.17."""

from collections.abc import Mapping, Sequence

import numpy as np

from chaosgym.machines import SliderCrank
from thesis.figures.computations import Computation, Data
from thesis.figures.crank import HIGH_DAMPING, LARGE, LOW_DAMPING, ROD_LENGTH, SECTION_4_4_DAMPING, SMALL, slider, sweep
from thesis.figures.figure import Finding, Parts, ThesisFigure, steps
from thesis.figures.flips import flips
from thesis.figures.panels import CRANK_SPEED, Mark, force_diagram, response_at
from thesis.figures.printed import comparison, printed
from thesis.figures.scored import agrees, scored, scored_finding

SPEEDING = slider(SMALL, contact_damping_ratio=SECTION_4_4_DAMPING)
LOOSE = slider(SMALL, contact_damping_ratio=LOW_DAMPING)
STIFF = slider(SMALL, contact_damping_ratio=HIGH_DAMPING)
WIDE_OPEN = slider(LARGE, contact_damping_ratio=HIGH_DAMPING)
RUBBING = slider(SMALL, contact_damping_ratio=LOW_DAMPING, friction_coefficient=0.1)


def over_speed(resolution: float, **machines: SliderCrank) -> Mapping[str, Computation]:
    """Peak forces from 100 to 300 rpm."""
    printed_speeds = [float(speed) for speed in range(100, 301, 10)]
    values = steps(100.0, 300.0, 10.0 / resolution, *printed_speeds)
    return {name: sweep(machine, "crank_speed", values) for name, machine in machines.items()}


def chaotic_share(data: Data, low: float, high: float) -> tuple[int, int]:
    """Chaotic runs, and all, on the printed grid of 10 rpm between two speeds."""
    speed = data["crank_speed"]
    inside = (speed >= low) & (speed <= high) & (np.abs(speed / 10.0 - np.round(speed / 10.0)) < 1e-9)
    return int(np.sum(data["nature"][inside] == "chaotic")), int(np.sum(inside))


def chaotic_band(parts: Parts) -> Sequence[Finding]:
    """Is the response chaotic from 110 to 190 rpm?"""
    chaotic, total = chaotic_share(parts["slider"], *printed("SSC-042"))
    more = f"chaotic at {chaotic} of the {total} printed speeds"
    return [scored_finding(parts, "SSC-042", "chaotic from 110 to 190 rpm", more=more)]


FORCE_AGAINST_SPEED = ThesisFigure(
    id="4.13",
    title=f"Peak impact force in the slider joint against crank speed: ±0.032 mm, damping {SECTION_4_4_DAMPING:.1%}",
    shows="Chaotic from 110 to 190 rpm and at other speeds, periodic at 100 and 200 rpm.",
    parts=lambda resolution: {**over_speed(resolution, slider=SPEEDING), **scored("SSC-042")},
    panels=(
        force_diagram(
            "",
            "slider",
            CRANK_SPEED,
            marks=(
                Mark(100.0, "SSC-043", "periodic", "none", "speed"),
                Mark(200.0, "SSC-044", "periodic", "none", "speed"),
            ),
        ),
    ),
    height=3.6,
    compare=chaotic_band,
)


def spread_of(data: Data) -> float:
    """Mean over speeds of the range of the peak forces [N]."""
    return float(np.nanmean(np.ptp(data["peaks"], axis=1)))


def no_chaos(parts: Parts) -> Sequence[Finding]:
    """Does all chaos vanish at 5 % contact damping?"""
    loose, stiff = parts["loose"], parts["a"]
    before, total = chaotic_share(loose, 100.0, 300.0)
    after, _ = chaotic_share(stiff, 100.0, 300.0)
    wild, wild_total = chaotic_share(parts["b"], 100.0, 300.0)
    return [
        scored_finding(parts, "SSC-049", "±0.032 mm: Type I, a smooth rise, to 180 rpm", sensitivity="speed"),
        scored_finding(parts, "SSC-055", "±0.254 mm: Type III, chaotic, from 100 rpm on", sensitivity="speed"),
        Finding(
            "±0.032 mm: chaos at 2.5 % contact damping, none at 5 %",
            f"chaotic at {before} of {total} speeds at 2.5 %, at {after} at 5 %; mean range {spread_of(loose):.2g} N "
            f"and {spread_of(stiff):.2g} N",
            agrees(parts, "SSC-066", "SSC-067"),
            ("SSC-066", "SSC-067"),
            "contact damping",
        ),
        Finding(
            "5 % contact damping: no chaos at ±0.032 mm, chaos at ±0.254 mm",
            f"chaotic at {after} of {total} speeds at ±0.032 mm, at {wild} of {wild_total} at ±0.254 mm",
            agrees(parts, "SSC-067", "SSC-055"),
            ("SSC-067", "SSC-055"),
            "clearance",
        ),
    ]


FORCE_FOR_CLEARANCES = ThesisFigure(
    id="4.14",
    title="Peak impact force in the slider joint for two clearances, contact damping 5 %",
    shows="Type I to 180 rpm and Type II above at the small clearance, Type III at the large one.",
    parts=lambda resolution: {
        **over_speed(resolution, a=STIFF, b=WIDE_OPEN, loose=LOOSE),
        **scored("SSC-049", "SSC-055", "SSC-066", "SSC-067"),
    },
    panels=(
        force_diagram(
            "(a) ±0.032 mm clearance (dimensionless 0.002)",
            "a",
            CRANK_SPEED,
            marks=(
                Mark(270.0, "SSC-051", "periodic", sensitivity="speed"),
                Mark(280.0, "SSC-052", "periodic", sensitivity="speed"),
                Mark(290.0, "SSC-053", "periodic", sensitivity="speed"),
            ),
            bands=(("I", "SSC-049"), ("II", "SSC-050")),
        ),
        force_diagram(
            "(b) ±0.254 mm clearance (dimensionless 0.016)",
            "b",
            CRANK_SPEED,
            marks=(
                Mark(190.0, "SSC-056", "chaotic", sensitivity="speed"),
                Mark(210.0, "SSC-057", "periodic", sensitivity="speed"),
                Mark(220.0, "SSC-058", "chaotic", sensitivity="speed"),
            ),
            bands=(("III", "SSC-055"),),
        ),
    ),
    height=3.5,
    compare=no_chaos,
)


def rod_lengths(resolution: float) -> Mapping[str, Computation]:
    """Rod lengths 235 to 265 mm at 250 rpm."""
    machine = slider(SMALL, crank_speed=250.0, contact_damping_ratio=LOW_DAMPING)
    return {"lengths": sweep(machine, "rod_length", steps(0.235, 0.265, 0.0025 / max(1, round(resolution))))}


def rod_flip(parts: Parts) -> Sequence[Finding]:
    """Does 1 % of rod length change the nature where printed, and where else?"""
    data = parts["lengths"]
    natures = [str(response_at(data, ROD_LENGTH, at)[1]) for at in (0.2575, 0.255)]
    return [
        Finding(
            "-1 % of rod length, 0.2575 to 0.255 m, turns periodic into chaotic",
            f"{natures[0]} to {natures[1]} there; the nature changes at {flips(data, ROD_LENGTH, 0.0025)}",
            natures == ["periodic", "chaotic"],
            ("SSC-060", "SSC-061"),
            "rod length",
        )
    ]


FORCE_AGAINST_ROD = ThesisFigure(
    id="4.16",
    title="Peak impact force against rod length: ±0.032 mm, 250 rpm, contact damping 2.5 %",
    shows="The nature changes for 1 % of length: 34 N, periodic, at 0.2575 m; 33 to 43 N, chaotic, at 0.255 m.",
    parts=rod_lengths,
    panels=(
        force_diagram(
            "",
            "lengths",
            ROD_LENGTH,
            marks=(
                Mark(0.2575, "SSC-060", "periodic", sensitivity="rod length"),
                Mark(0.255, "SSC-061", "chaotic", sensitivity="rod length"),
            ),
        ),
    ),
    height=3.6,
    compare=rod_flip,
)


FRICTION_SPEEDS = {"SSC-064": 230.0, "SSC-065": 260.0}
"""Speeds [rpm] of the statements about friction."""


def friction_natures(end: int) -> tuple[tuple[float, str], ...]:
    """Printed natures, without friction (0) and with it (1)."""
    return tuple((speed, str(comparison(name).printed).split(" to ")[end]) for name, speed in FRICTION_SPEEDS.items())


def friction_flips(parts: Parts) -> Sequence[Finding]:
    """Does friction change the nature where printed, and where else?"""
    found: list[Finding] = []
    pairs = zip(parts["without"]["crank_speed"], parts["without"]["nature"], parts["with"]["nature"], strict=True)
    changed: dict[str, list[str]] = {}
    for speed, one, other in pairs:
        if one != other:
            changed.setdefault(f"{one} to {other}", []).append(f"{speed:g}")
    elsewhere = ", ".join(f"{kind} at {', '.join(speeds)} rpm" for kind, speeds in changed.items())
    for target, speed in FRICTION_SPEEDS.items():
        wanted = tuple(str(comparison(target).printed).split(" to "))
        natures = tuple(str(response_at(parts[name], CRANK_SPEED, speed)[1]) for name in ("without", "with"))
        found.append(
            Finding(
                f"{speed:g} rpm: friction of 0.1 turns {wanted[0]} into {wanted[1]}",
                f"{natures[0]} to {natures[1]} there" + ("" if found else f"; {elsewhere or 'no change'}"),
                natures == wanted,
                (target,),
                "friction",
            )
        )
    return found


FORCE_WITH_FRICTION = ThesisFigure(
    id="4.17",
    title="Effect of friction in the slider joint: ±0.032 mm, contact damping 2.5 %",
    shows="Friction of 0.1 turns 230 rpm from periodic to chaotic and 260 rpm from chaotic to periodic.",
    parts=lambda resolution: over_speed(resolution, **{"without": LOOSE, "with": RUBBING}),
    panels=(
        force_diagram("(a) without friction", "without", CRANK_SPEED, natures=friction_natures(0)),
        force_diagram("(b) with friction, coefficient 0.1", "with", CRANK_SPEED, natures=friction_natures(1)),
    ),
    height=3.3,
    compare=friction_flips,
)

FIGURES = (FORCE_AGAINST_SPEED, FORCE_FOR_CLEARANCES, FORCE_AGAINST_ROD, FORCE_WITH_FRICTION)
