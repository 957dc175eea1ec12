"""Maps of the beam's chaos. Figures 3.9 and 3.18."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from matplotlib.axes import Axes

from chaosgym.machines import ImpactBeam
from chaosgym.machines.impact_beam.modes import static_tip_deflection
from thesis import plotting as thesis
from thesis.figures.beam import LARGE
from thesis.figures.computations import Computation, Types
from thesis.figures.criterion import criterion_rate
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure, steps
from thesis.figures.panels import FREQUENCY
from thesis.figures.printed import printed
from thesis.figures.scored import scored, scored_finding


def beam_map(resolution: float) -> Mapping[str, Computation]:
    """Natures and types over frequency and dimensionless clearance."""
    unit = static_tip_deflection(ImpactBeam())
    shares = steps(0.005, 0.05, 0.005 / resolution)
    return {
        "map": Types(
            machine=ImpactBeam(),
            speeds=steps(2.0, 30.0, 2.0 / resolution),
            clearances=tuple(unit * share for share in shares),
        ),
        **scored("IBS-030", "IBS-031"),
    }


def map_axes(parts: Parts, ax: Axes) -> None:
    """Draw the beam's map on the axes of the thesis."""
    data = parts["map"]
    share = data["clearance"] / static_tip_deflection(ImpactBeam())
    thesis.nature_plane(data["speed"], share, data["nature"], ax, types=data["type"])
    corner = printed("IBS-031").low, printed("IBS-030").low
    ax.plot([corner[0], corner[0], 30.5], [0.0525, corner[1], corner[1]], lw=1.6, ls="--", **thesis.PRINTED)
    ax.set(xlabel=FREQUENCY.label, ylabel="dimensionless clearance")


def with_measured(parts: Parts, ax: Axes) -> None:
    """The same, with the points of the measured curves that the text gives."""
    map_axes(parts, ax)
    unit = static_tip_deflection(ImpactBeam())
    ax.plot(printed("IBS-065").low, LARGE / unit, "s", ms=8, mfc="none", mew=1.8, **thesis.PRINTED)
    ends = [printed("IBS-054").high, printed("IBS-056").high]
    ax.plot(ends, [0.016e-3 / unit, LARGE / unit], "^", ms=8, mfc="none", mew=1.8, **thesis.PRINTED)


def criterion(parts: Parts) -> Sequence[Finding]:
    """Chaos only above the printed clearance and frequency?"""
    data = parts["map"]
    places = [(s, c) for s in data["speed"] for c in data["clearance"]]
    machines = [replace(ImpactBeam(), excitation_frequency=float(s), clearance=float(c)) for s, c in places]
    rate = criterion_rate(machines, [str(kind) for kind in data["nature"].ravel()])  # type: ignore[misc]
    return [
        scored_finding(parts, "IBS-030", "chaos only above dimensionless clearance 0.02", sensitivity="clearance"),
        scored_finding(parts, "IBS-031", "chaos only above 16 Hz", sensitivity="speed"),
        Finding(
            "chaos only above both",
            f"{rate.hit_rate:.0%} of the chaotic points lie there; {rate.precision:.0%} of the points there are "
            f"chaotic, {1.0 - rate.quiet:.0%} of the others",
            None,
            (),
            "clearance",
        ),
    ]


NATURE_MAP = ThesisFigure(
    id="3.9",
    title="Nature of the response over frequency and clearance",
    shows="Open circles periodic, dots chaotic, three regions of types; chaos above clearance 0.02 and 16 Hz (dashed).",
    parts=beam_map,
    panels=(Panel("dashed: printed corner of chaos", map_axes),),
    height=4.6,
    compare=criterion,
)

MEASURED_MAP = ThesisFigure(
    id="3.18",
    title="Figure 3.9 with what the text tells of the measured boundaries",
    shows="Figure 3.9 with two measured curves: predictable to unpredictable, and Type I to Type II.",
    parts=beam_map,
    panels=(Panel("square: measured Type II/III boundary; triangles: measured Type I/II boundary", with_measured),),
    height=4.6,
    compare=criterion,
    remark="of the measured curves only the three points of the text",
)

FIGURES = (
    NATURE_MAP,
    MEASURED_MAP,
)
