"""The mechanism of Type II (thesis 3.5.1): force over speed, and the speeds that divide the first contact mode.

python -m thesis.figures.type_two FILE
"""

import sys
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from chaosgym.arrays import Array
from chaosgym.machines import ImpactBeam
from chaosgym.machines.impact_beam.modes import modal_analysis
from chaosgym.simulation import simulate
from thesis.scorecard.candidates import read_candidate

CLEARANCE = 0.03175e-3
"""Of figure 3.8 a [m]."""

PRINTED = ((18.0, 30.5), (19.0, 15.0), (20.0, 28.0))
"""Peak forces [N] at speeds [Hz] (3.5.1); the speed of the middle one is not printed."""

RISE_ENDS = 8.0
"""Speed [Hz] up to which the force rises smoothly (3.5.1)."""

ORDERS = (3, 5, 7)
"""Half cycles that hold a whole number and a half of periods of the first contact mode."""


def first_contact_mode(beam: ImpactBeam) -> float:
    """Lowest natural frequency [Hz] of a beam whose tip rests on a sensor."""
    modes = modal_analysis(beam)
    stiffness = np.diag(modes.angular_frequency**2)
    stiffness += beam.contact_stiffness * np.outer(modes.tip_shape, modes.tip_shape)
    return float(np.sqrt(np.linalg.eigvalsh(stiffness)[0]) / (2.0 * np.pi))


def force_curve(beam: Any, speeds: Array) -> tuple[Array, Array]:
    """Smallest and largest peak force [N] of 50 settled cycles at each speed, on one side."""
    peaks = [
        simulate(replace(beam, excitation_frequency=float(speed), clearance=CLEARANCE), 50, transient=100).peak_force
        for speed in speeds
    ]
    return np.array([one[:, 0].min() for one in peaks]), np.array([one[:, 0].max() for one in peaks])


def figure() -> Figure:
    """Draw the beam beside the former default, of a hard pivot, with what is printed."""
    speeds = np.arange(2.0, 30.01, 0.25)
    drawn = Figure(figsize=(8.0, 4.5), layout="constrained")
    panel = drawn.subplots()
    beam = ImpactBeam()
    for one, colour, label in ((read_candidate("former").machine, "0.65", "hard pivot"), (beam, "C0", "ImpactBeam()")):
        low, high = force_curve(one, speeds)
        panel.fill_between(speeds, low, high, color=colour, alpha=0.4, lw=0)
        panel.plot(speeds, 0.5 * (low + high), color=colour, label=label)
    mode = first_contact_mode(beam)
    for order in ORDERS:
        panel.axvline(mode / order, color="C0", ls=":", lw=1)
        panel.annotate(
            f"$f_1/{order}$", (mode / order, 0.98), xycoords=("data", "axes fraction"), rotation=90, va="top"
        )
    panel.plot(*zip(*PRINTED, strict=True), "k^", label="printed: 30.5, 15 and 28 N")
    panel.axvline(RISE_ENDS, color="k", lw=1, label="printed: smooth rise ends")
    panel.set(xlabel="excitation frequency [Hz]", ylabel="peak force [N]", xlim=(2.0, 30.0), ylim=(0.0, None))
    panel.set_title(f"±0.032 mm, figure 3.8 a; first contact mode: {mode:.1f} Hz", fontsize=10)
    panel.legend(loc="lower right")
    return drawn


if __name__ == "__main__":
    figure().savefig(sys.argv[1], dpi=130)
