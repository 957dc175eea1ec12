"""The slider crank at work in the environments."""

from chaosgym.machines.machine import TaskDefaults

TASK_DEFAULTS = TaskDefaults(
    # figure 4.14b, with an assumed contact damping of 6.5 %: with the printed 5 % hardly a speed is calm, with 8 %
    # backing off finds a calm one at once (docs/development/tasks.md)
    fields={"slider_clearance": 0.254e-3, "contact_damping_ratio": 0.065},
    model={"fidelity": "draft"},
    tolerances={"slider_clearance": 0.1},
    # assumed, as for the beam; less of the contact's damping, since hardly a speed is calm with 5 %
    fleet={"damping_ratio": 0.5, "contact_damping_ratio": 0.2, "contact_stiffness": 0.3, "slider_mass": 0.05},
    task={
        "cycles_per_step": 20,
        "lowest_speed": 120.0,
        "highest_speed": 300.0,
        "slew_limit": 40.0,
        "speed_grid": 5.0,
        "trim_step": 5.0,
        "largest_trim": 40.0,
        "lowest_demand": 150.0,
        "highest_demand": 290.0,
        "smallest_change": 20.0,
        "largest_change": 80.0,
        "start_below": 40.0,
        "kick": 3e-4,
        "speed_ripple": 0.0,
        "deviation_weight": 0.0125,
        "reference_force": 140.0,
    },
)
