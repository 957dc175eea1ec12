"""Resonances of the rod with high orders of the crank speed. Figure 4.18."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from chaosgym.arrays import Array
from chaosgym.machines import SliderCrank
from chaosgym.plotting.style import ACCENT, MUTED, NATURE_COLOURS
from thesis import plotting as thesis
from thesis.figures.computations import Computation, Data
from thesis.figures.crank import WIDE, slider, sweep
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure, steps
from thesis.figures.panels import CRANK_SPEED
from thesis.figures.printed import printed
from thesis.figures.scored import scored, scored_finding

SUPERHARMONIC_SLIDER_CRANK = SliderCrank(
    contact_stiffness=1.5e7,
    contact_damping_mass=0.0,
    ball_damping_mass=0.0,
    fitted_modes=0,
    matrix_update_interval=1.0,
    crank_speed=1508.0,
    slider_clearance=0.127e-3,
    n_modes=4,
    damping_ratio=0.0007,
    damping_family="uniform",
    housing_mass=0.4,
    housing_inertia=5.68e-4,
    housing_offset_along=0.035,
    yoke_mass=0.25,
    yoke_inertia=5.68e-4,
    yoke_offset_along=-0.040,
    slider_mass=0.1,
)
"""The mechanism of figure 4.18: end bodies whose centres of gravity lie along the rod excite its first mode."""

ORDERS = {5: 907.0, 4: 1134.0, 3: 1512.0}
"""Speeds [rpm] at which these orders meet the first natural frequency of 75.6 Hz."""

TARGETS = {5: "SSC-070", 4: "SSC-071", 3: "SSC-072"}
SPEEDS = {5: 900.0, 4: 1140.0, 3: 1500.0}
"""As printed; for order 5 the print says 600 rpm and 15 Hz, which is 900 rpm."""

WINDOW = 0.04
"""Share of the speed within which a resonance is sought."""

SETTLING = 150
"""Revolutions in which a lightly damped rod settles."""


def speeds(resolution: float) -> tuple[float, ...]:
    """Speeds [rpm] to 1600, dense around the resonances."""
    dense = [
        speed
        for centre in ORDERS.values()
        for share, step in ((0.06, 15.0), (0.012, 2.0))
        for speed in steps((1.0 - share) * centre, (1.0 + share) * centre, step / resolution)
    ]
    return steps(100.0, 1600.0, 50.0 / resolution, *(float(f"{speed:.6g}") for speed in dense))


def superharmonics(resolution: float) -> Mapping[str, Computation]:
    """The machine of the thesis, and the one whose end bodies lie along the rod, with clearance and without."""
    values = speeds(resolution)
    offset = replace(SUPERHARMONIC_SLIDER_CRANK, slider_clearance=WIDE)
    return {
        "thesis": sweep(slider(WIDE), "crank_speed", values, cycles=50, transient=SETTLING),
        "offset": sweep(offset, "crank_speed", values, cycles=50, transient=SETTLING),
        "tight": sweep(replace(offset, slider_clearance=0.0), "crank_speed", values, cycles=20, transient=SETTLING),
        **scored(*TARGETS.values(), "SSC-073"),
    }


def largest(data: Data) -> tuple[Array, Array]:
    """Speed [rpm] and largest peak force [N]."""
    return data["crank_speed"], np.asarray(data["peaks"].max(axis=1))


def resonance(data: Data, order: int) -> tuple[float, float, float]:
    """Speed and force of the largest local maximum near an order, and how far it stands above the ends of the window.

    Without a local maximum inside the window the last number is 1 at most.
    """
    speed, force = largest(data)
    centre = ORDERS[order]
    inside = np.flatnonzero((np.abs(speed / centre - 1.0) <= WINDOW) & np.isfinite(force))
    top = int(inside[np.argmax(force[inside])])
    background = max(float(force[inside[0]]), float(force[inside[-1]]))
    return float(speed[top]), float(force[top]), float(force[top]) / background


def paint_resonances(parts: Parts, ax: Axes, *, part: str, tight: str | None = None) -> None:
    """Largest and all peak forces against the speed."""
    data = parts[part]
    speed, force = largest(data)
    peaks = data["peaks"]
    for kind in ("periodic", "chaotic", "undetermined"):
        of_kind = data["nature"] == kind
        ax.plot(
            np.repeat(speed[of_kind], peaks.shape[1]),
            peaks[of_kind].ravel(),
            ".",
            ms=2.2,
            mew=0.0,
            color=NATURE_COLOURS[kind],
            rasterized=True,
        )
        ax.plot([], [], ".", ms=8.0, mew=0.0, color=NATURE_COLOURS[kind], label=kind)
    ax.plot(speed, force, lw=0.7, color=ACCENT)
    if tight is not None:
        ax.plot(*largest(parts[tight]), lw=1.0, ls="--", color=MUTED, label="largest, zero clearance")
    for order, at in SPEEDS.items():
        thesis.printed_span(at, at, ax, "resonances, printed (5th, 4th, 3rd order)" if order == 5 else None)
    ax.plot(SPEEDS[3], printed("SSC-073").low, "D", mfc="none", ms=7, mew=1.6, **thesis.PRINTED)
    ax.set(
        xlabel=CRANK_SPEED.label, ylabel="peak impact force [N]", yscale="log", ylim=(5.0, 6000.0), xlim=(80.0, 1620.0)
    )
    ax.legend(loc="upper left", fontsize=8.0, ncols=2)


def orders_found(parts: Parts) -> Sequence[Finding]:
    """Is there a local maximum at each order? The machine of the thesis decides; the other one is told beside it."""
    found = []
    for order, target in TARGETS.items():
        texts = []
        for part, name in (("offset", "offset end bodies"), ("tight", "the same, tight")):
            at, force, ratio = resonance(parts[part], order)
            about = f"{force:.0f} N at {at:.0f} rpm, {ratio:.3g} times the background"
            texts.append(f"{name}: {about if ratio > 1.02 else 'no local maximum'}")
        where = "15 Hz, that is 900 rpm" if order == 5 else f"{SPEEDS[order]:g} rpm"
        found.append(
            scored_finding(
                parts,
                target,
                f"resonance of order {order} at {where}",
                more="; ".join(texts),
                sensitivity="flexibility",
            )
        )
    wanted = printed("SSC-073").low
    _, force, _ = resonance(parts["offset"], 3)
    _, free, _ = resonance(parts["tight"], 3)
    return [
        *found,
        scored_finding(
            parts,
            "SSC-073",
            f"up to {wanted:g} N at 1500 rpm",
            more=f"offset end bodies: {force:.0f} N",
            sensitivity="flexibility",
        ),
        Finding(
            "resonances do not depend on the clearance and are there at zero clearance",
            f"with offset end bodies order 3 has {force:.0f} N at ±0.127 mm, {free:.0f} N at zero clearance",
            None,
            ("SSC-074",),
            "flexibility",
        ),
    ]


SUPERHARMONICS = ThesisFigure(
    id="4.18",
    title="Superharmonic resonances of the rod: peak impact force to 1600 rpm, ±0.127 mm",
    shows="Local maxima at orders 5, 4 and 3 of the crank speed, up to 2500 N at 1500 rpm.",
    parts=superharmonics,
    panels=(
        Panel("(a) the machine that fits figures 4.13 to 4.16", partial(paint_resonances, part="thesis")),
        Panel(
            "(b) end bodies whose centres of gravity lie along the rod, structural damping 0.07 %",
            partial(paint_resonances, part="offset", tight="tight"),
        ),
    ),
    height=3.8,
    compare=orders_found,
    remark="the force axis is logarithmic; no one set of parameters gives both the resonances and figures 4.13 to 4.16",
)

FIGURES = (SUPERHARMONICS,)
