"""A class of machines with several joints, whose fields default to those of a structure, its joints and its drive.

kind = machine_with_joints(
    Structure.of_modes([9.0, 61.0], 0.01, {"middle": [2.1, -1.9], "end": [1.2, 0.8]}),
    {"left": Joint("middle", 1e-4, 1e6, 20.0), "right": Joint("end", 2e-4, 1e6, 20.0)},
    (Drive.sine("force", "end", 8.9),),
)
machine = kind(speed=19.0, left_clearance=2e-4)
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Number
from chaosgym.machines.modal_machine.drive import Drive
from chaosgym.machines.modal_machine.friction import MINDLIN, OF_FRICTION
from chaosgym.machines.modal_machine.jointed import LARGEST, JointedMachine
from chaosgym.machines.modal_machine.machine import OF_JOINT, ModalMachine, clearance_option
from chaosgym.machines.modal_machine.structure import Structure
from chaosgym.machines.parameters import described_as, parameters_of
from chaosgym.machines.stated import class_with, refuse_names
from chaosgym.units import TURNING


class Joint(NamedTuple):
    """A joint of a structure; see the fields of ``ModalMachine``.

    ``at`` is the point that moves in the gap, such as "tip", "-tip" or "pinion - wheel"; ``clearance`` [m] half the
    gap; ``stiffness`` [N/m] and ``damping`` [N s/m] of the upper stop, and factors of the lower one's; ``offset`` [m]
    of the middle of the gap; ``stops`` "two" or "one"; ``preload`` [N] towards the upper stop. ``turns`` says that m
    is rad and N is N m.

    A joint with a ``tangent``, the point whose motion is along its surfaces, has Coulomb ``friction`` there: a slider
    in series with a tangential spring, ``tangential_factor`` times that of the stop. The surfaces move at
    ``sliding_speed`` [m/s], positive where the tangential displacement grows.

    Examples
    --------
    >>> chaosgym.Joint("tip", clearance=1e-4, stiffness=1e6, damping=20.0).stops
    'two'
    """

    at: str
    clearance: float
    stiffness: float
    damping: float
    offset: float = 0.0
    stops: str = "two"
    lower_stiffness_factor: float = 1.0
    lower_damping_factor: float = 1.0
    preload: float = 0.0
    turns: bool = False
    tangent: str = ""
    friction: float = 0.0
    tangential_factor: float = MINDLIN
    sliding_speed: float = 0.0


def machine_with_joints(
    structure: Structure,
    joints: Mapping[str, Joint],
    drives: tuple[Drive, ...] = (),
    *,
    about: Mapping[str, Any] | None = None,
    usual_ranges: Mapping[str, tuple[float, float]] | None = None,
    namespace: Mapping[str, Any] | None = None,
    definition: Any = None,
    **stated: Any,
) -> Any:
    """Class of machines with several joints, whose fields default to what is given.

    Parameters
    ----------
    structure, drives
        As of ``ModalMachine``.
    joints
        By their names, which begin the names of their fields.
    about
        Provenance and source of what is given.
    usual_ranges
        Of the speed, as "speed", and of the clearance of the first or monitored joint, as "clearance".
    namespace
        More attributes of the class.
    definition
        Field that tells the class from others.
    stated
        Other fields of ``JointedMachine``, such as ``speed`` or ``monitored``.

    Raises
    ------
    ParameterError
        If there is no joint, a name can't begin that of a field, or a value is out of range.

    Examples
    --------
    >>> structure = chaosgym.Structure.of_modes([9.0, 61.0], 0.01, {"middle": [2.1, -1.9], "end": [1.2, 0.8]})
    >>> joints = {name: chaosgym.Joint(name, 1e-4, 1e6, 20.0) for name in ("middle", "end")}
    >>> kind = chaosgym.machine_with_joints(structure, joints, (chaosgym.Drive.sine("force", "end", 8.9),))
    >>> machine = kind(speed=19.0, end_clearance=2e-4)
    >>> machine.sides
    ('middle upper', 'middle lower', 'end upper', 'end lower')
    """
    if not joints:
        raise ParameterError("a machine has no joint; allowed: one or more")
    about = {"provenance": "assumed", "source": "default", **(about or {})}
    defaults: dict[str, Any] = {"modes": structure, "drives": drives}
    known = parameters_of(ModalMachine)
    refuse_names("joint name", joints, "left_1")
    for name, joint in joints.items():
        described = {what: known[same] for what, same in OF_JOINT.items()} | (OF_FRICTION if joint.tangent else {})
        for what, usual_field in described.items():
            value, unit = getattr(joint, what), usual_field.unit
            usual_factor = what == "tangential_factor" and value == MINDLIN
            more = {"unit": TURNING.get(unit, unit) if joint.turns else unit, **({} if usual_factor else about)}
            defaults[f"{name}_{what}"] = described_as(usual_field, value, **more)
    own = parameters_of(JointedMachine)
    defaults["monitored"] = described_as(own["monitored"], stated.pop("monitored", LARGEST), choices=(LARGEST, *joints))
    if definition is not None:
        defaults["definition"] = definition
    for name, value in stated.items():
        defaults[name] = described_as(own[name], value, **about)
    usual = {"speed": (4.0, 30.0), "clearance": (2e-5, 2e-4), **(usual_ranges or {})}
    watched = defaults["monitored"].default
    first = next(iter(joints)) if watched == LARGEST else watched
    types: dict[str, Any] = {
        "places": {name: joint.at for name, joint in joints.items()},
        "tangents": {name: joint.tangent for name, joint in joints.items() if joint.tangent},
        "usual_ranges": {"speed": usual["speed"], f"{first}_clearance": usual["clearance"]},
        "options": {
            "--speed-hz": Number("speed", "Hz"),
            **clearance_option(f"{first}_clearance", joints[first].turns),
        },
        "turning": tuple(name for name, joint in joints.items() if joint.turns),
        **(namespace or {}),
    }
    return class_with(JointedMachine, defaults, types)
