"""Which machine does which task stand for? Nominal machine, tolerances and numbers of every machine that has a task.

The conditions are those under which there is something to feel and something to win, not those of the thesis: on its
beam (damping ratio 1 %, 8.9 N) 74 to 83 % of the speeds above 18 Hz are chaotic, and no schedule helps.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chaosgym.envs.task import Task
from chaosgym.machines.machine import Machine


@dataclass(frozen=True)
class Setup:
    """A machine at work.

    ``fields`` of the nominal machine that differ from the machine's own defaults; ``model_fidelity`` rung of the model
    that controllers may use, one below that of the machine; ``tolerances`` half widths as shares of the nominal value.
    """

    fields: Mapping[str, Any]
    model_fidelity: str | None
    tolerances: Mapping[str, float]
    task: Task


SETUPS = {
    "impact-beam": Setup(
        # twice the thesis' force at its gap, and three times its damping (assumed)
        fields={"force_amplitude": 17.8, "clearance": 0.127e-3, "damping_ratio": 0.03},
        model_fidelity="draft",
        # clearance: repeatability of the thesis' feeler gauges (3.4, printed); damping and length: assumed
        tolerances={"clearance": 0.2, "damping_ratio": 0.2, "length": 0.002},
        task=Task(speed_ripple=0.002, load_rating=80.0),
    ),
    "slider-crank": Setup(
        # figure 4.14b; the contact damping is assumed: more of it makes Type III rare and too weak to be felt
        fields={"slider_clearance": 0.254e-3, "contact_damping_ratio": 0.13},
        model_fidelity="draft",
        tolerances={"slider_clearance": 0.1, "contact_damping_ratio": 0.1, "rod_length": 0.002},
        task=Task(
            cycles_per_step=20,
            lowest_speed=120.0,
            highest_speed=300.0,
            slew_limit=40.0,
            speed_grid=5.0,
            trim_step=5.0,
            largest_trim=40.0,
            lowest_demand=150.0,
            highest_demand=290.0,
            smallest_change=20.0,
            largest_change=80.0,
            start_below=40.0,
            kick=3e-4,
            deviation_weight=0.0125,
            load_rating=141.3,
        ),
    ),
}


def setup_of(machine: type[Machine]) -> Setup:
    """Setup of a machine; one of its usual ranges for a machine that has none of its own."""
    if machine.name in SETUPS:
        return SETUPS[machine.name]
    low, high = machine.usual_ranges[machine.speed_field]
    span = high - low
    clearance = machine().clearance_field
    task = Task(
        lowest_speed=low,
        highest_speed=high,
        slew_limit=span / 7,
        trim_step=span / 56,
        largest_trim=span / 7,
        lowest_demand=low + span / 7,
        highest_demand=high,
        smallest_change=span / 14,
        largest_change=span / 3.5,
        start_below=span / 7,
        deviation_weight=3.5 / span,
        speed_ripple=0.002 if machine().carries_deviations else 0.0,
    )
    return Setup({}, None, {clearance: 0.1}, task)
