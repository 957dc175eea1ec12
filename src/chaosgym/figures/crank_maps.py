"""Where does the slider crank rattle, and where chaotically? Figures 4.8, 4.9 and 4.15."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from chaosgym.diagnosis.criteria import criterion_rate
from chaosgym.diagnosis.type_rule import types_on_grid
from chaosgym.figures.computations import Computation, Data, Runs
from chaosgym.figures.crank import CYCLES, HIGH_DAMPING, LARGE, MIDDLE, SMALL, TRANSIENT, WIDE, ball, slider, sweep
from chaosgym.figures.figure import Finding, Panel, Parts, ThesisFigure, steps
from chaosgym.figures.panels import CRANK_SPEED, Mark, force_diagram
from chaosgym.figures.printed import printed
from chaosgym.plotting import thesis
from chaosgym.plotting.design import INK

LOSS = 1e-3
"""Share of a revolution without contact from which on contact counts as lost, and resumed with an impact."""

BALL_TRANSIENT = 20
"""Revolutions in which a ball joint settles."""

MAP_CLEARANCES = (SMALL, MIDDLE, 0.09525e-3, WIDE, 0.1905e-3, LARGE)

DIMENSIONLESS = LARGE / 0.016
"""Clearance [m] of dimensionless clearance 1, as printed for ±0.254 mm (4.5.1)."""


def ball_speeds(resolution: float) -> Mapping[str, Computation]:
    """Ball joint over the speed."""
    marks = (120.0, 130.0, 140.0, 280.0)
    return {
        "ball": sweep(ball(WIDE), "crank_speed", steps(50.0, 300.0, 10.0 / resolution, *marks), cycles=CYCLES,
                      transient=BALL_TRANSIENT)
    }  # fmt: skip


def impact_speeds(data: Data) -> NDArray[np.float64]:
    """Speeds [rpm] at which contact is lost."""
    return np.asarray(data["crank_speed"][data["contact"] < 1.0 - LOSS])


def impact_spans(parts: Parts, ax: Axes) -> None:
    """Printed speeds with impacts."""
    thesis.printed_span(*printed("SSC-028"), ax, "impacts, printed")
    thesis.printed_span(*printed("SSC-029"), ax, None)
    here = impact_speeds(parts["ball"])
    ax.plot(here, np.full(len(here), 1.0), "^", ms=4, mew=0, color=INK, label="impacts here",
            transform=ax.get_xaxis_transform(), clip_on=False)  # fmt: skip


def ball_impacts(parts: Parts) -> Sequence[Finding]:
    """At which speeds are there impacts?"""
    here = impact_speeds(parts["ball"])
    low, high = printed("SSC-028")
    slow = here[here < 250.0]
    ends = f"{slow.min():g} to {slow.max():g} rpm" if len(slow) else "nowhere"
    isolated = printed("SSC-029").low
    agrees = bool(len(slow) and abs(slow.min() - low) <= 10.0 and abs(slow.max() - high) <= 10.0)
    fast = here[here >= 250.0]
    return [
        Finding(f"impacts from {low:g} to {high:g} rpm", ends, agrees, ("SSC-028",)),
        Finding(f"impacts at {isolated:g} rpm", ", ".join(f"{speed:g} rpm" for speed in fast) or "none above 250 rpm",
                bool(isolated in fast), ("SSC-029",)),
    ]  # fmt: skip


BALL_FORCE_AGAINST_SPEED = ThesisFigure(
    id="4.8",
    title="Peak contact force in the ball joint against crank speed: spherical clearance, ±0.127 mm",
    shows="Impacts from 110 to 190 rpm and at 280 rpm; chaos at 120, 130 and 140 rpm.",
    parts=ball_speeds,
    panels=(
        force_diagram("", "ball", CRANK_SPEED, extra=impact_spans,
                      marks=tuple(Mark(speed, target, "chaotic", "none") for speed, target in
                                  ((120.0, "SSC-030"), (130.0, "SSC-031"), (140.0, "SSC-032")))),
    ),
    height=3.8,
    compare=ball_impacts,
)  # fmt: skip


def ball_map(resolution: float) -> Mapping[str, Computation]:
    """Ball joint over speed and clearance."""
    machines = tuple(
        ball(clearance, crank_speed=speed)
        for speed in steps(80.0, 340.0, 20.0 / resolution)
        for clearance in (SMALL, MIDDLE, WIDE, LARGE)
    )
    return {
        "map": Runs(
            machines=machines, fields=("crank_speed", "ball_clearance"), cycles=CYCLES, transient=BALL_TRANSIENT
        )
    }


def on_grid(data: Data, clearance_field: str) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, int]]:
    """Speeds, clearances and shape of a map."""
    speed, clearance = np.unique(data["crank_speed"]), np.unique(data[clearance_field])
    return speed, clearance, (len(speed), len(clearance))


def ball_plane(parts: Parts, ax: Axes) -> None:
    """Natures of the ball joint; stars where contact is kept."""
    data = parts["map"]
    speed, clearance, shape = on_grid(data, "ball_clearance")
    nature = np.where(data["contact"] < 1.0 - LOSS, data["nature"], "no impacts").reshape(shape)
    thesis.printed_span(*printed("SSC-033"), ax)
    thesis.nature_plane(speed, 1e3 * clearance, nature, ax)
    ax.set(xlabel=CRANK_SPEED.label, ylabel="clearance [mm]", ylim=(0.0, None))


def ball_region(parts: Parts) -> Sequence[Finding]:
    """Are there impacts only from 100 to 200 rpm, and none above 300?"""
    data = parts["map"]
    speed, gap = data["crank_speed"], data["ball_clearance"]
    lost = data["contact"] < 1.0 - LOSS
    low, high = printed("SSC-033")
    small = lost & (gap < WIDE - 1e-9)
    ends = f"{speed[small].min():g} to {speed[small].max():g} rpm" if np.any(small) else "nowhere"
    inside = bool(np.any(small) and speed[small].min() >= low and speed[small].max() <= high)
    fastest = float(speed[lost].max()) if np.any(lost) else 0.0
    chaos = data["nature"] == "chaotic"
    return [
        Finding(f"below ±0.127 mm impacts only from {low:g} to {high:g} rpm", ends, inside, ("SSC-033",)),
        Finding("no impacts above 300 rpm", f"up to {fastest:g} rpm", fastest <= printed("SSC-034").low, ("SSC-034",)),
        Finding("chaos only where there are impacts",
                f"{np.sum(chaos & lost)} of {np.sum(chaos)} chaotic points have impacts",
                bool(np.all(lost[chaos])), ("SSC-033",)),
    ]  # fmt: skip


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
    machines = tuple(
        slider(clearance, crank_speed=speed, contact_damping_ratio=HIGH_DAMPING)
        for speed in steps(60.0, 300.0, 10.0 / max(1, round(resolution)))
        for clearance in MAP_CLEARANCES
    )
    return {
        "map": Runs(machines=machines, fields=("crank_speed", "slider_clearance"), cycles=CYCLES, transient=TRANSIENT)
    }


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
    machines = [slider(float(gap), crank_speed=float(speed), contact_damping_ratio=HIGH_DAMPING)
                for speed, gap in columns]  # fmt: skip
    rate = criterion_rate(machines, [str(kind) for kind in data["nature"]])  # type: ignore[misc]
    return [
        Finding(
            "chaos only above dimensionless clearance 0.004 (±0.064 mm) and 100 rpm",
            f"{rate.hit_rate:.0%} of the chaotic points lie there; of the points there {rate.precision:.0%} are "
            f"chaotic, of those outside {1.0 - rate.quiet:.0%}",
            rate.hit_rate >= 0.95, ("SSC-117", "SSC-118"), "clearance",
        )
    ]  # fmt: skip


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
