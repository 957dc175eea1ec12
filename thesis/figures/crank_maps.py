"""Maps of the slider crank's rattling and chaos. Figures 4.8, 4.9 and 4.15."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from chaosgym.diagnosis.type_rule import types_on_grid
from chaosgym.plotting.style import INK
from thesis import plotting as thesis
from thesis.figures.computations import Computation, Data
from thesis.figures.crank import HIGH_DAMPING, LARGE, MIDDLE, SMALL, WIDE, ball, runs, slider, sweep
from thesis.figures.criterion import criterion_rate
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure, steps
from thesis.figures.findings import words
from thesis.figures.panels import CRANK_SPEED, Mark, force_diagram
from thesis.figures.printed import printed
from thesis.figures.scored import scored, scored_finding
from thesis.scorecard.crank_quantities import LOST

BETWEEN = 0.09525e-3
"""A clearance [m] on the same grid."""

MAP_CLEARANCES = (SMALL, MIDDLE, BETWEEN, WIDE, 0.1905e-3, LARGE)

DIMENSIONLESS = LARGE / 0.016
"""Clearance [m] of dimensionless clearance 1, as printed for ±0.254 mm (4.5.1)."""


def ball_speeds(resolution: float) -> Mapping[str, Computation]:
    """Ball joint over the speed."""
    marks = (120.0, 130.0, 140.0, 280.0)
    return {
        "ball": sweep(ball(WIDE), "crank_speed", steps(50.0, 300.0, 10.0 / resolution, *marks)),
        **scored("SSC-028", "SSC-029"),
    }


def impact_speeds(data: Data) -> NDArray[np.float64]:
    """Speeds [rpm] at which contact is lost."""
    return np.asarray(data["crank_speed"][data["contact"] < 1.0 - LOST])


def impact_spans(parts: Parts, ax: Axes) -> None:
    """Printed speeds with impacts."""
    thesis.printed_span(*printed("SSC-028"), ax, "impacts, printed")
    thesis.printed_span(*printed("SSC-029"), ax, None)
    here = impact_speeds(parts["ball"])
    ax.plot(
        here,
        np.full(len(here), 1.0),
        "^",
        ms=4,
        mew=0,
        color=INK,
        label="impacts here",
        transform=ax.get_xaxis_transform(),
        clip_on=False,
    )


def ball_impacts(parts: Parts) -> Sequence[Finding]:
    """At which speeds are there impacts?"""
    return [
        scored_finding(parts, "SSC-028", f"impacts from {words(printed('SSC-028'))} rpm"),
        scored_finding(parts, "SSC-029", f"impacts at {words(printed('SSC-029'))} rpm"),
    ]


BALL_FORCE_AGAINST_SPEED = ThesisFigure(
    id="4.8",
    title="Peak contact force in the ball joint against crank speed: spherical clearance, ±0.127 mm",
    shows="Impacts from 110 to 190 rpm and at 280 rpm; chaos at 120, 130 and 140 rpm.",
    parts=ball_speeds,
    panels=(
        force_diagram(
            "",
            "ball",
            CRANK_SPEED,
            extra=impact_spans,
            marks=tuple(
                Mark(speed, target, "chaotic", "none")
                for speed, target in ((120.0, "SSC-030"), (130.0, "SSC-031"), (140.0, "SSC-032"))
            ),
        ),
    ),
    height=3.8,
    compare=ball_impacts,
)


def ball_map(resolution: float) -> Mapping[str, Computation]:
    """Ball joint over speed and clearance."""
    machines = [
        ball(clearance, crank_speed=speed)
        for speed in steps(50.0, 340.0, 10.0 / resolution)
        for clearance in (SMALL, MIDDLE, BETWEEN, WIDE, LARGE)
    ]
    return {"map": runs(machines, "crank_speed", "ball_clearance"), **scored("SSC-033", "SSC-034")}


def on_grid(data: Data, clearance_field: str) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, int]]:
    """Speeds, clearances and shape of a map."""
    speed, clearance = np.unique(data["crank_speed"]), np.unique(data[clearance_field])
    return speed, clearance, (len(speed), len(clearance))


def ball_plane(parts: Parts, ax: Axes) -> None:
    """Natures of the ball joint; stars where contact is kept."""
    data = parts["map"]
    speed, clearance, shape = on_grid(data, "ball_clearance")
    nature = np.where(data["contact"] < 1.0 - LOST, data["nature"], "no impacts").reshape(shape)
    thesis.printed_span(*printed("SSC-033"), ax)
    thesis.nature_plane(speed, 1e3 * clearance, nature, ax)
    ax.set(xlabel=CRANK_SPEED.label, ylabel="clearance [mm]", ylim=(0.0, None))


def ball_region(parts: Parts) -> Sequence[Finding]:
    """Are there impacts only from 100 to 200 rpm, and none above 300?"""
    data = parts["map"]
    lost, chaos = data["contact"] < 1.0 - LOST, data["nature"] == "chaotic"
    speeds = words(printed("SSC-033"))
    return [
        scored_finding(parts, "SSC-033", f"below ±0.127 mm impacts from {speeds} rpm, and only there"),
        scored_finding(parts, "SSC-034", "no impacts above 300 rpm"),
        Finding(
            "chaos only where there are impacts",
            f"{np.sum(chaos & lost)} of {np.sum(chaos)} chaotic points have impacts",
            bool(np.all(lost[chaos])),
        ),
    ]


BALL_MAP = ThesisFigure(
    id="4.9",
    title="Nature of the response over crank speed and clearance of the ball joint",
    shows="Stars without impacts, circles periodic and dots chaotic with impacts, which lie between 100 and 200 rpm.",
    parts=ball_map,
    panels=(Panel("shaded: impacts at clearances below ±0.127 mm, printed", ball_plane),),
    height=4.0,
    compare=ball_region,
)


def slider_map(resolution: float) -> Mapping[str, Computation]:
    """Slider joint over speed and clearance."""
    machines = [
        slider(clearance, crank_speed=speed, contact_damping_ratio=HIGH_DAMPING)
        for speed in steps(60.0, 300.0, 10.0 / max(1, round(resolution)))
        for clearance in MAP_CLEARANCES
    ]
    return {"map": runs(machines, "crank_speed", "slider_clearance"), **scored("SSC-117", "SSC-118")}


def slider_plane(parts: Parts, ax: Axes) -> None:
    """Natures, and types over a drift of 10 rpm."""
    data = parts["map"]
    speed, clearance, shape = on_grid(data, "slider_clearance")
    nature = data["nature"].reshape(shape)
    reach = round(10.0 / float(speed[1] - speed[0]))
    types = types_on_grid(nature, data["peaks"].max(axis=1).reshape(shape), axes=(0,), reach=reach)
    every = slice(None, None, reach)
    thesis.nature_plane(speed[every], clearance / DIMENSIONLESS, nature[every], ax, types=types[every])
    corner = printed("SSC-118").low, printed("SSC-117").low
    ax.plot([corner[0], corner[0], 303.0], [0.0175, corner[1], corner[1]], lw=1.6, ls="--", **thesis.PRINTED)
    ax.set(xlabel=CRANK_SPEED.label, ylabel="dimensionless clearance")


def slider_criterion(parts: Parts) -> Sequence[Finding]:
    """Chaos only above the printed clearance and speed?"""
    data = parts["map"]
    columns = zip(data["crank_speed"], data["slider_clearance"], strict=True)
    machines = [
        slider(float(gap), crank_speed=float(speed), contact_damping_ratio=HIGH_DAMPING) for speed, gap in columns
    ]
    rate = criterion_rate(machines, [str(kind) for kind in data["nature"]])  # type: ignore[misc]
    return [
        scored_finding(
            parts, "SSC-117", "chaos only above dimensionless clearance 0.004 (±0.064 mm)", sensitivity="clearance"
        ),
        scored_finding(parts, "SSC-118", "chaos only above 100 rpm", sensitivity="speed"),
        Finding(
            "chaos only above both",
            f"{rate.hit_rate:.0%} of the chaotic points lie there; {rate.precision:.0%} of the points there are "
            f"chaotic, {1.0 - rate.quiet:.0%} of the others",
            None,
            (),
            "clearance",
        ),
    ]


SLIDER_MAP = ThesisFigure(
    id="4.15",
    title="Nature of the response over crank speed and clearance of the slider joint, contact damping 5 %",
    shows="Open circles periodic, dots chaotic, three regions of types; chaos above 0.004 and 100 rpm (dashed).",
    parts=slider_map,
    panels=(Panel("dashed: printed corner of chaos; types over a drift of 10 rpm", slider_plane),),
    height=4.4,
    compare=slider_criterion,
)

FIGURES = (BALL_FORCE_AGAINST_SPEED, BALL_MAP, SLIDER_MAP)
