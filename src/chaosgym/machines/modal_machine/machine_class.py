"""A class of machines with several joints, whose fields default to those of a structure, its joints and its drive.

kind = machine_with_joints(
    Structure.of_modes([9.0, 61.0], 0.01, {"middle": [2.1, -1.9], "end": [1.2, 0.8]}),
    {"left": Joint("middle", 1e-4, 1e6, 20.0), "right": Joint("end", 2e-4, 1e6, 20.0)},
    (Drive.sine("force", "end", 8.9),),
)
machine = kind(speed=19.0, left_clearance=2e-4)
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from chaosgym.core.binned.model import LINEAR
from chaosgym.errors import ParameterError
from chaosgym.machines.friction_law import MINDLIN, OF_FRICTION
from chaosgym.machines.machine import SPEED_IN_HZ
from chaosgym.machines.modal_machine.drive import Drive
from chaosgym.machines.modal_machine.held_joints import HeldJoints
from chaosgym.machines.modal_machine.jointed import LARGEST, JointedMachine
from chaosgym.machines.modal_machine.machine import OF_JOINT, ModalMachine, clearance_option
from chaosgym.machines.modal_machine.structure import Structure
from chaosgym.machines.modal_machine.varying import HeldSpring
from chaosgym.machines.parameters import Parameter, described_as, parameters_of
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

    ``exponent`` is n of a Hertzian stop, whose ``stiffness`` is K [N/m^n] and whose ``damping`` is chi [s/m];
    ``samples`` are its stiffness over the cycle, in any unit; ``slides`` is a point that slides past one way.

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
    exponent: float = LINEAR
    samples: tuple[float, ...] = ()
    slides: str = ""

    @property
    def is_held(self) -> bool:
        """Whether it needs held matrices or Taylor series."""
        return bool(self.exponent or self.samples or self.slides)

    @property
    def described(self) -> Mapping[str, Parameter]:
        """What is known of it."""
        usual = parameters_of(ModalMachine)
        found = {what: usual[same] for what, same in OF_JOINT.items()}
        if self.exponent:
            units = {"stiffness": f"N/m^{self.exponent:g}", "damping": "s/m"}
            found |= {what: replace(found[what], unit=unit, high=1e18) for what, unit in units.items()}
        if self.slides:
            found["friction"] = OF_FRICTION["friction"]
        return {**found, **OF_FRICTION} if self.tangent else found


def _held(joints: Mapping[str, Joint], springs: tuple[HeldSpring, ...]) -> str:
    """What needs held matrices or Taylor series."""
    for name, joint in joints.items():
        if joint.slides:
            return f"{name}.slides"
        if joint.samples:
            return f"{name}.stiffness over the cycle"
        if joint.exponent:
            return f"{name}.hertz_stiffness"
    return f"the spring over the cycle at {springs[0].at!r}"


def machine_with_joints(
    structure: Structure,
    joints: Mapping[str, Joint],
    drives: tuple[Drive, ...] = (),
    *,
    springs: tuple[HeldSpring, ...] = (),
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
    springs
        Whose stiffness varies over the cycle.
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
        If there is no joint, a name can't begin that of a field, or a value is out of range or does not go with others.

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
    refuse_names("joint name", joints, "left_1")
    holds = bool(springs) or any(joint.is_held for joint in joints.values())
    base: Any = HeldJoints if holds else JointedMachine
    for name, joint in joints.items():
        if holds and joint.tangent:
            raise ParameterError(
                f"{_held(joints, springs)} does not go with {name}.tangent; allowed: slides in its place"
            )
        for what, usual_field in joint.described.items():
            value, unit = getattr(joint, what), usual_field.unit
            stated_here = value != Joint._field_defaults.get(what)
            more = {"unit": TURNING.get(unit, unit) if joint.turns else unit, **(about if stated_here else {})}
            defaults[f"{name}_{what}"] = described_as(usual_field, value, **more)
    own = parameters_of(base)
    watched = stated.pop("monitored", next(iter(joints)) if holds else LARGEST)
    choices = tuple(joints) if holds else (LARGEST, *joints)
    defaults["monitored"] = described_as(own["monitored"], watched, choices=choices)
    if definition is not None:
        defaults["definition"] = definition
    for name, value in stated.items():
        defaults[name] = described_as(own[name], value, **about)
    usual = {"speed": (4.0, 30.0), "clearance": (2e-5, 2e-4), **(usual_ranges or {})}
    first = next(iter(joints)) if watched == LARGEST else watched
    types: dict[str, Any] = {
        "places": {name: joint.at for name, joint in joints.items()},
        "tangents": {name: joint.tangent for name, joint in joints.items() if joint.tangent},
        "usual_ranges": {"speed": usual["speed"], f"{first}_clearance": usual["clearance"]},
        "options": {
            **SPEED_IN_HZ,
            **clearance_option(f"{first}_clearance", joints[first].turns),
        },
        "turning": tuple(name for name, joint in joints.items() if joint.turns),
        **(namespace or {}),
    }
    if holds:
        defaults["springs"] = springs
        types["exponents"] = {name: joint.exponent for name, joint in joints.items()}
        types["samples"] = {name: joint.samples for name, joint in joints.items() if joint.samples}
        types["slides"] = {name: joint.slides for name, joint in joints.items() if joint.slides}
        types["beside_matrices"] = ("speed", *(f"{name}_clearance" for name in joints))
        del types["tangents"]
    return class_with(base, defaults, types)
