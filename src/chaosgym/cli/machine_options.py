"""How does a command line describe a machine? Short options in shop-floor units, ``--set FIELD=VALUE`` for the rest.

A number option sets one field; a choice option sets several at once, such as which joints have clearance, and
``--fidelity`` those that make the model a rung of the machine's ladder.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import click

from chaosgym.errors import ParameterError

STANDARD_GRAVITY = 9.81


class Number(NamedTuple):
    """A number: the field that it sets, its unit on the command line, and how many SI units that is.

    ``joints`` are the words of ``--clearance-joint`` with which it makes sense; all if there are none.
    """

    field: str
    unit: str
    factor: float = 1.0
    joints: tuple[str, ...] = ()


class Choice(NamedTuple):
    """A word: the fields that each word sets, and the options that it redirects to another field."""

    words: Mapping[str, Mapping[str, Any]]
    redirects: Mapping[str, Mapping[str, str]] = {}
    joints: tuple[str, ...] = ()


_BALL_ALONE = {"slider_joint": "ideal", "gravity": STANDARD_GRAVITY}

MACHINE_OPTIONS: Mapping[str, Mapping[str, Number | Choice]] = {
    "impact-beam": {
        "--frequency-hz": Number("excitation_frequency", "Hz"),
        "--clearance-mm": Number("clearance", "mm", 1e-3),
    },
    "slider-crank": {
        "--clearance-joint": Choice(
            {
                "slider": {"slider_joint": "clearance", "ball_joint": "ideal"},
                "ball-spherical": {"ball_joint": "spherical", **_BALL_ALONE},
                "ball-instrumented": {"ball_joint": "instrumented", **_BALL_ALONE},
                "both": {"slider_joint": "clearance", "ball_joint": "spherical"},
            },
            redirects={
                "ball-spherical": {"--clearance-mm": "ball_clearance"},
                "ball-instrumented": {"--clearance-mm": "ball_clearance"},
            },
        ),
        "--slider-model": Choice(
            {"plain": {"slider_joint": "clearance"}, "instrumented": {"slider_joint": "instrumented"}},
            joints=("slider", "both"),
        ),
        "--ball-model": Choice(
            {"spherical": {"ball_joint": "spherical"}, "instrumented": {"ball_joint": "instrumented"}},
            joints=("both",),
        ),
        "--gravity": Choice({"on": {"gravity": STANDARD_GRAVITY}, "off": {"gravity": 0.0}}),
        "--speed-rpm": Number("crank_speed", "rpm"),
        "--clearance-mm": Number("slider_clearance", "mm", 1e-3),
        "--ball-clearance-mm": Number("ball_clearance", "mm", 1e-3, ("ball-spherical", "ball-instrumented", "both")),
        "--motor-angle-deg": Number("motor_angle", "deg"),
        "--contact-damping-ratio": Number("contact_damping_ratio", "-"),
        "--friction": Number("friction_coefficient", "-"),
    },
}
"""By machine: its options, in the order in which they take effect. Every other field is reached by ``--set``."""


def machine_command(function: Callable[..., None], *, required: bool = True) -> Callable[..., None]:
    """Give a command the MACHINE argument, the options of all machines, ``--set`` and ``--json``.

    The function receives ``machine`` (constructed, or None if it is not required and not given) and ``as_json``.
    """
    owners: dict[str, list[str]] = {}
    kinds: dict[str, Number | Choice] = {}
    for machine, options in MACHINE_OPTIONS.items():
        for name, kind in options.items():
            owners.setdefault(name, []).append(machine)
            kinds[name] = kind

    @functools.wraps(function)
    def wrapped(machine: str | None, settings: tuple[str, ...], fidelity: str | None, **others: Any) -> None:
        given = {name: others.pop(name.lstrip("-").replace("-", "_")) for name in kinds}
        given = {name: value for name, value in given.items() if value is not None}
        if machine is None and (settings or given or fidelity):
            raise click.UsageError(f"these options need a machine: {', '.join(MACHINE_OPTIONS)}")
        function(machine=machine and build_machine(machine, given, settings, fidelity), **others)

    for name, kind in reversed(kinds.items()):
        values: Any = click.Choice(list(kind.words)) if isinstance(kind, Choice) else float
        wrapped = click.option(name, type=values, default=None, help=f"[{', '.join(owners[name])}]")(wrapped)
    wrapped = click.option(
        "--fidelity", metavar="RUNG", help="Rung of the machine's ladder of models, such as rigid or reference."
    )(wrapped)
    wrapped = click.option(
        "--set", "settings", multiple=True, metavar="FIELD=VALUE", help="Any field of the machine, in SI; repeatable."
    )(wrapped)
    wrapped = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")(wrapped)
    return click.argument("machine", type=click.Choice(sorted(MACHINE_OPTIONS)), required=required)(wrapped)


def build_machine(name: str, given: Mapping[str, Any], settings: tuple[str, ...], fidelity: str | None = None) -> Any:
    """Build the machine that a command line describes; what is not given is as in the thesis.

    Raises
    ------
    click.UsageError
        If an option is not the machine's, or its value is not allowed; names option, value and range.
    """
    from chaosgym.machines import MACHINES
    from chaosgym.machines.parameters import with_settings

    owner = MACHINES[name]
    known = MACHINE_OPTIONS[name]
    for option in given:
        if option not in known:
            raise click.UsageError(
                f"{option} is no option of {name}; it takes {', '.join(known)} and --set FIELD=VALUE"
            )
    fields: dict[str, Any] = {}
    redirects: dict[str, str] = {}
    numbers: dict[str, str] = {}
    for option, kind in known.items():
        if option not in given:
            continue
        joint = given.get("--clearance-joint", "slider")
        if kind.joints and joint not in kind.joints:
            raise click.UsageError(f"{option} goes with --clearance-joint {' or '.join(kind.joints)}, not with {joint}")
        if isinstance(kind, Choice):
            fields |= kind.words[given[option]]
            redirects |= kind.redirects.get(given[option], {})
        else:
            field = redirects.get(option, kind.field)
            if field in numbers:
                raise click.UsageError(f"{numbers[field]} and {option} both set {field}")
            numbers[field] = option
            fields[field] = _checked(owner, option, kind._replace(field=field), given[option])
    for text in settings:
        field, value = _setting(text)
        if field in numbers:
            raise click.UsageError(f"{field} is given twice: by {numbers[field]} and by --set")
        fields[field] = value
    return with_settings(owner(), fields if fidelity is None else {**fields, "fidelity": fidelity})


def _checked(owner: Any, option: str, number: Number, value: float) -> float:
    """SI value of a number option; the message speaks of the option in its own unit."""
    from chaosgym.machines.parameters import check_parameter, parameters_of

    try:
        return float(check_parameter(owner, number.field, value * number.factor))
    except ParameterError as error:
        described = parameters_of(owner)[number.field]
        unit = "" if number.unit == "-" else f" {number.unit}"
        low, high = described.low / number.factor, described.high / number.factor
        raise click.UsageError(f"{option} = {value:g} is out of range; allowed: {low:g} to {high:g}{unit}") from error


def _setting(text: str) -> tuple[str, Any]:
    """Parse FIELD=VALUE."""
    field, separator, value = text.partition("=")
    if not separator or not field or not value:
        raise click.UsageError(f"--set {text!r} is not of the form FIELD=VALUE")
    try:
        return field, int(value) if value.lstrip("+-").isdigit() else float(value)
    except ValueError:
        return field, value
