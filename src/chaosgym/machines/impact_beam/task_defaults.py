"""The impact beam in the environments: force and range of speed, tolerances, and numbers of the task."""

from chaosgym.machines.machine import TaskDefaults

TASK_DEFAULTS = TaskDefaults(
    # twice the thesis' force, and speeds about the onset of chaos (assumed): with less force, or at higher speeds,
    # chaos fills whole ranges that no trim leaves (docs/development/tasks.md)
    fields={"force_amplitude": 17.8, "clearance": 0.127e-3},
    # one fitted mode less than the rung standard, whatever the machine's own model
    model={
        "n_modes": 4,
        "fitted_modes": 1,
        "contact_law": "linear",
        "reduction": "free",
        "event_accuracy": "standard",
    },
    # repeatability of the thesis' feeler gauges (3.4, printed). Damping and length move the calm speeds too, but no
    # sensor tells them
    tolerances={"clearance": 0.2},
    # assumed: damping and contact are known to a factor of two at best, a shaker's force and a mass are measured
    fleet={
        "damping_ratio": 0.5,
        "contact_damping": 0.5,
        "contact_stiffness": 0.3,
        "force_amplitude": 0.1,
        "density": 0.02,
    },
    task={
        "lowest_speed": 10.0,
        "highest_speed": 24.0,
        "slew_limit": 2.0,
        "trim_step": 0.25,
        "largest_trim": 2.0,
        "lowest_demand": 12.0,
        "highest_demand": 23.0,
        "smallest_change": 1.0,
        "largest_change": 4.0,
        "start_below": 2.0,
        "deviation_weight": 0.25,
        "speed_ripple": 0.002,
        "reference_force": 95.0,
    },
)
