"""The class of machines that are one mechanism: a field for all that may differ between two of them."""

from collections.abc import Mapping
from typing import Any

from chaosgym.errors import ParameterError
from chaosgym.machines.friction_law import FRICTION_FIELDS, Friction
from chaosgym.machines.machine import SPEED_IN_RPM, Number
from chaosgym.machines.mechanism.joints import Clearance
from chaosgym.machines.mechanism.machine import MechanismMachine
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.motor import LINE, MOTOR_FIELDS, Motor
from chaosgym.machines.parameters import assumed, described_as, parameter, parameters_of
from chaosgym.machines.stated import class_with, refuse_names


def machine_of(
    mechanism: Mechanism,
    clearances: Mapping[str, Clearance],
    *,
    monitored: str = "",
    motor: Motor | None = None,
    frictions: Mapping[str, Friction] | None = None,
    about: Mapping[str, Any] | None = None,
    usual_ranges: Mapping[str, tuple[float, float]] | None = None,
    namespace: Mapping[str, Any] | None = None,
    definition: Any = None,
    **stated: Any,
) -> Any:
    """Class of machines that are one mechanism, whose fields default to what is given.

    Parameters
    ----------
    mechanism
        Its links and joints; those with clearance are opened as ``opened_by`` says.
    clearances
        Of these joints, by their names.
    monitored
        Joint whose motion and force are recorded; the first with clearance if empty.
    motor
        Its values are those of the ``MOTOR_FIELDS``, its speed in rpm; none for a speed that is held.
    frictions
        Of joints with or without clearance, by their names.
    about
        Provenance and source of what is given.
    usual_ranges
        Of the speed, as "speed", and of the clearance of the monitored joint, as "clearance".
    namespace
        More attributes of the class.
    definition
        Field that tells the class from others.
    stated
        Other fields of ``MechanismMachine``, such as ``speed``.

    Raises
    ------
    ParameterError
        If no joint has clearance, a name can't begin that of a field, or a value is out of range.

    Examples
    --------
    >>> from chaosgym.machines.mechanism.joints import Clearance
    >>> from chaosgym.machines.mechanism.machine_class import machine_of
    >>> from chaosgym.machines.mechanism.joints import LinkJoint
    >>> from chaosgym.machines.mechanism.links import Body, rigid_link
    >>> from chaosgym.machines.mechanism.mechanism import Mechanism
    >>> crank = rigid_link("crank", {"shaft": (0.0, 0.0), "pin": (0.05, 0.0)})
    >>> rod = rigid_link("rod", {"big": (0.0, 0.0), "small": (0.2, 0.0)}, (Body(0.5, 1e-3, (0.1, 0.0)),))
    >>> slider = rigid_link("slider", {"pivot": (0.0, 0.0)}, (Body(1.0, 1e-3, (0.0, 0.0)),))
    >>> joints = (
    ...     LinkJoint("motor", "revolute", ("ground", "shaft"), ("crank", "shaft"), driven=True),
    ...     LinkJoint("big_end", "revolute", ("crank", "pin"), ("rod", "big")),
    ...     LinkJoint("small_end", "revolute", ("rod", "small"), ("slider", "pivot")),
    ...     LinkJoint("guide", "prismatic", ("ground", "shaft"), ("slider", "pivot"), opened=("across",)),
    ... )
    >>> mechanism = Mechanism((crank, rod, slider), joints, {"shaft": (0.0, 0.0)}, (0.0, -9.81))
    >>> kind = machine_of(mechanism, {"guide": Clearance(1e-4, 1e8, 100.0)})
    >>> kind(speed=10.0).sides
    ('upper', 'lower')
    """
    if not clearances:
        raise ParameterError("no joint has clearance: nothing rattles; allowed: clearance in at least one [[joint]]")
    about = {"provenance": "assumed", "source": "default", **(about or {})}
    watched = monitored or next(iter(clearances))
    if watched not in clearances:
        raise ParameterError(f"monitored = {watched!r} is not one of {', '.join(clearances)}, which have clearance")
    frictions = frictions or {}
    refuse_names("name", (*clearances, *frictions, *(link.name for link in mechanism.links)), "big_end")
    fields: dict[str, Any] = {"mechanism": mechanism}
    for name, given in clearances.items():
        for what, (value, described) in given.fields.items():
            fields[f"{name}_{what}"] = parameter(value, **described, **about)
    for name, friction in frictions.items():
        for (what, described), part in zip(FRICTION_FIELDS.items(), friction, strict=True):
            if part is not None:
                fields[f"{name}_{what}"] = parameter(part, **described, **about)
    for (what, described), number in zip(MOTOR_FIELDS.items(), motor or (), strict=False):
        fields[what] = parameter(number, **described, **about)
    for link in mechanism.links:
        if link.mass.any() or link.inertia.any():
            fields[f"{link.name}_mass_factor"] = assumed(1.0, "-", 1e-3, 1e3)
    own = parameters_of(MechanismMachine)
    fields["monitored"] = described_as(own["monitored"], watched, **about, choices=tuple(clearances))
    if definition is not None:
        fields["definition"] = definition
    for name, value in stated.items():
        fields[name] = described_as(own[name], value, **about)
    usual = {"speed": (100.0, 1000.0), "clearance": (1e-5, 2e-4), **(usual_ranges or {})}
    types: dict[str, Any] = {
        "stations": {name: given.stations for name, given in clearances.items()},
        "rubs": tuple(frictions),
        "has_motor": motor is not None,
        "motor_curve": LINE if motor is None else motor.curve,
        "laws": {name: given.exponent for name, given in clearances.items()},
        # friction of a tight joint changes with the speed in no power of it, and so does one that falls with it
        "beside_matrices": (
            *(["speed"] if all(name in clearances and each.is_steady for name, each in frictions.items()) else []),
            *(f"{name}_clearance" for name in clearances),
            *(MOTOR_FIELDS if motor else ()),
        ),
        "usual_ranges": {"speed": usual["speed"], f"{watched}_clearance": usual["clearance"]},
        "options": {
            **SPEED_IN_RPM,
            "--clearance-mm": Number(f"{watched}_clearance", "mm", 1e-3),
        },
        **(namespace or {}),
    }
    return class_with(MechanismMachine, fields, types)
