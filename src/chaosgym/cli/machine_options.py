"""The machine of a command line: short options in shop-floor units, ``--set FIELD=VALUE`` for the rest.

A number option sets one field; a choice option sets several at once, such as which joints have clearance, and
``--fidelity`` those that make the model a rung of the machine's ladder. Options are the machine's own. Numbers may have
a unit, as in ``0.127 mm``; bare ones are in the option's.
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from chaosgym.cli.options import Quantity
from chaosgym.cli.output import AS_JSON, note_machine, note_model
from chaosgym.errors import ParameterError
from chaosgym.machines import FILE_ENDING, MACHINES

if TYPE_CHECKING:
    from chaosgym.machines.machine import Number, Option

ASKED = "chaosgym.tolerance"
"""Where a command keeps the tolerance that its model is chosen for; None for a model that is stated."""

START_CYCLES = 32
"""Cycles from rest by which the box of random initial states is scaled."""


INITIAL_STATE = click.option(
    "--initial-state",
    metavar="FILE|rest|random:SEED",
    help="State from which it runs: a file of its numbers in SI units, or JSON; rest if left out.",
)


def millimetres_meant(field: str, written: str, value: float, usual: float) -> str:
    """Doubt about a bare number in metres that looks like millimetres; empty if there is none."""
    from chaosgym.units import looks_like_millimetres

    if not written[-1:].isdigit() or not looks_like_millimetres(value, usual):
        return ""
    return (
        f"note: {field} = {written} is {value:g} m, where {usual:g} m are usual; for millimetres write '{written} mm'"
    )


class MachineName(click.ParamType):  # type: ignore[type-arg]
    """Name of a machine that is registered when the command runs, or the file of one's own."""

    name = "machine"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return the known names, as ``click.Choice`` shows them."""
        names = "|".join([*sorted(MACHINES), f"FILE{FILE_ENDING}"])
        return f"{{{names}}}" if param.required else f"[{names}]"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the names that begin so, and files."""
        names = [CompletionItem(name) for name in sorted(MACHINES) if name.startswith(incomplete)]
        return names or [CompletionItem(incomplete, type="file")]

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name, or say which there are."""
        if value not in MACHINES:
            near = get_close_matches(value, MACHINES, 1)
            hint = f"; did you mean {near[0]}?" if near else "."
            hint = f"; a recording is judged by: chaosgym judge {value}" if Path(value).is_file() else hint
            names = ", ".join(repr(name) for name in sorted(MACHINES))
            self.fail(f"{value!r} is not one of {names}, nor a file that ends in {FILE_ENDING}{hint}", param, ctx)
        return str(value)


class MachineCommand(click.Command):
    """A command with the options of the machine that is named on its line.

    ``before`` is called with the arguments before the machine is imported.
    """

    def __init__(self, *args: Any, before: Callable[[list[str]], None] | None = None, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self._before = before

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse with the options of the machine; one of another machine ends in a line that names the own ones."""
        if self._before is not None:
            self._before(args)
        named = [argument for argument in args if argument in MACHINES][:1]
        ctx.meta[__name__] = named
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            if error.option_name not in _options_of(MACHINES):
                raise
            message = f"{error.option_name} is an option of a machine; name it: {', '.join(MACHINES)}, or its file"
            if named:
                known = ", ".join(MACHINES[named[0]].options)
                message = f"{error.option_name} is no option of {named[0]}; it takes {known} and --set FIELD=VALUE"
            raise click.UsageError(message, ctx) from error

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the command's own parameters and the machine's, whose rungs stand in the help of ``--fidelity``."""
        named = ctx.meta.get(__name__, ())
        own = [_fidelity_of(named[0]) if named and one.name == "fidelity" else one for one in super().get_params(ctx)]
        return [*_options_of(named).values(), *own]

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Say where the options of a machine are, if none is named."""
        super().format_epilog(ctx, formatter)
        if not ctx.meta.get(__name__):
            formatter.write_paragraph()
            formatter.write_text(f"A machine has options of its own: {ctx.command_path} MACHINE --help")


ALLOWED = "Error of the peak force that is allowed ('1 %'), or "
"""How the help of ``--fidelity`` begins."""


def _fidelity_of(machine: str) -> click.Option:
    """The option ``--fidelity`` of a machine."""
    rungs = list(MACHINES[machine].fidelity_ladder)
    told = f"one of {', '.join(rungs)}." if len(rungs) > 1 else f"{rungs[0]}, the only model of this machine."
    return click.Option(["--fidelity"], metavar="ERROR|RUNG", help=ALLOWED + told)


def _options_of(machines: Iterable[str]) -> dict[str, click.Option]:
    """Options of some machines by name; the help says whose each is."""
    if not machines:
        return {}
    from chaosgym.machines.machine import Choice

    owners: dict[str, list[str]] = {}
    kinds: dict[str, Option] = {}
    for machine in machines:
        for name, kind in MACHINES[machine].options.items():
            owners.setdefault(name, []).append(machine)
            kinds[name] = kind
    return {
        name: click.Option(
            [name],
            type=click.Choice(list(kind.words)) if isinstance(kind, Choice) else Quantity(kind.unit),
            help=f"[{', '.join(owners[name])}]",
        )
        for name, kind in kinds.items()
    }


def machine_command(
    function: Callable[..., None] | None = None,
    *,
    required: bool = True,
    before: Callable[[list[str]], None] | None = None,
    chooses: str = "",
) -> Any:
    """Make a command with the MACHINE argument, the options of that machine, ``--set``, ``--fidelity`` and ``--json``.

    The function receives ``machine`` (constructed, or None if it is not required and not given) and ``as_json``.
    Where it ``chooses`` a model, at the machine's "point" or by ``model_over`` itself over a "range", the answer names
    the model, which is within ``DEFAULT_TOLERANCE`` if none is stated.
    """
    if function is None:
        return functools.partial(machine_command, required=required, before=before, chooses=chooses)
    own = {parameter.name for parameter in getattr(function, "__click_params__", [])} | {"as_json"}

    @functools.wraps(function)
    def wrapped(
        machine: str | None,
        settings: tuple[str, ...],
        fidelity: str | None,
        initial_state: str | None = None,
        **others: Any,
    ) -> None:
        given = {f"--{name.replace('_', '-')}": others.pop(name) for name in set(others) - own}
        given = {name: value for name, value in given.items() if value is not None}
        if machine is None and (settings or given or fidelity or initial_state):
            raise click.UsageError(f"these options need a machine: {', '.join(MACHINES)}")
        built, stated = build_machine(machine, given, settings, fidelity) if machine else (None, False)
        if built and (chooses or fidelity is not None):
            from chaosgym.machines.accuracy import DEFAULT_TOLERANCE

            # a state belongs to one model
            stated = stated or bool(built.initial_state) or initial_state not in (None, "rest", *_random(initial_state))
            click.get_current_context().meta[ASKED] = None if stated else fidelity or DEFAULT_TOLERANCE
            built = built if chooses == "range" else model_over(built)
        if built and initial_state:
            built = built.from_state(stated_state(built, initial_state))
        if built:
            note_machine(built)
        function(machine=built, **others)

    wrapped = INITIAL_STATE(wrapped)
    wrapped = click.option(
        "--fidelity",
        metavar="ERROR|RUNG",
        help=f"{ALLOWED}a name of the machine's ladder of models, which MACHINE --help lists.",
    )(wrapped)
    wrapped = click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="FIELD=VALUE",
        help="Any field of the machine, in SI or with its unit ('clearance=0.1 mm'); repeatable.",
    )(wrapped)
    wrapped = AS_JSON(wrapped)
    wrapped = click.argument("machine", type=MachineName(), required=required)(wrapped)
    return click.command(cls=MachineCommand, before=before)(wrapped)


def model_over(machine: Any, points: Iterable[Any] = (), *, chosen: Iterable[str] = ()) -> Any:
    """The machine by the model that the command line asks for, at all of some operating points; the answer names it.

    A model of which a field is ``chosen`` otherwise, such as by an axis, stays as it is.
    """
    from chaosgym.machines import accuracy

    asked = click.get_current_context().meta.get(ASKED, accuracy.DEFAULT_TOLERANCE)
    points, stated = tuple(points), asked is None or bool(set(chosen) & set(machine.model_fields))
    found = accuracy.accuracy_of(machine, points) if stated else accuracy.model_within(machine, asked, points)
    note_model(found)
    return found.machine


def _random(initial_state: str | None) -> tuple[str, ...]:
    """The text itself, if it asks for a random start, which any model has."""
    return (initial_state,) if initial_state is not None and initial_state.startswith("random:") else ()


def stated_state(machine: Any, text: str) -> Any:
    """State that --initial-state names; one of the random starts of the search for other motions by its seed."""
    if text == "rest":
        return ()
    if text.startswith("random:"):
        from chaosgym.diagnosis.start_box import start_box
        from chaosgym.simulation import rest_state, simulate

        seed = text.removeprefix("random:")
        if not seed.isdecimal():
            raise click.UsageError(f"--initial-state {text!r} has no seed; allowed: random:0, random:1, ...")
        return start_box(machine, simulate(machine, START_CYCLES, rest_state(machine))).draw(1, int(seed))[0]
    try:
        content = Path(text).read_text("utf-8")
        return [float(word) for word in content.translate(str.maketrans("[],;", "    ")).split()]
    except OSError as error:
        raise click.UsageError(f"--initial-state {text!r} can't be read: {error.strerror}") from error
    except ValueError as error:
        raise click.UsageError(
            f"--initial-state {text!r} holds no numbers alone; allowed: a state in SI units"
        ) from error


def build_machine(
    name: str, given: Mapping[str, Any], settings: tuple[str, ...], fidelity: str | None = None
) -> tuple[Any, bool]:
    """Build the machine that a command line describes, and say whether its model is stated, by a rung or a field of it.

    What is not given is as in the thesis. A tolerance is checked here; it is met later.

    Raises
    ------
    click.UsageError
        If an option is not the machine's, or its value is not allowed; names option, value and range.
    """
    from chaosgym.machines.accuracy import is_tolerance
    from chaosgym.machines.machine import Choice
    from chaosgym.machines.parameters import expand_fidelity, with_settings

    owner = MACHINES[name]
    known: Mapping[str, Any] = owner.options
    fields: dict[str, Any] = {}
    redirects: dict[str, str] = {}
    numbers: dict[str, str] = {}
    notes: list[str] = []
    for option, kind in known.items():
        if option not in given:
            continue
        for other, words in kind.only.items():
            word = given.get(other, next(iter(known[other].words)))
            if word not in words:
                raise click.UsageError(f"{option} goes with {other} {' or '.join(words)}, not with {word}")
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
        field, value, note = _setting(owner, text)
        notes += [note] if note else []
        if field in numbers:
            raise click.UsageError(f"{field} is given twice: by {numbers[field]} and by --set")
        fields[field] = value
    rung = fidelity is not None and not is_tolerance(fidelity)
    machine = with_settings(owner(), expand_fidelity(owner, {**fields, "fidelity": fidelity}))
    for note in notes:
        click.echo(note, err=True)
    return machine, rung or any(field in owner.model_fields for field in fields)


def _checked(owner: Any, option: str, number: "Number", value: float) -> float:
    """SI value of a number option; the message speaks of the option in its own unit."""
    from chaosgym.machines.parameters import check_parameter, parameters_of

    try:
        return float(check_parameter(owner, number.field, value * number.factor))
    except ParameterError as error:
        described = parameters_of(owner)[number.field]
        unit = "" if number.unit == "-" else f" {number.unit}"
        low, high = described.low / number.factor, described.high / number.factor
        raise click.UsageError(f"{option} = {value:g} is out of range; allowed: {low:g} to {high:g}{unit}") from error


def _setting(owner: Any, text: str) -> tuple[str, Any, str]:
    """Parse FIELD=VALUE, where a number may have a unit: (field, value, a doubt about it)."""
    from chaosgym.machines.parameters import field_named, parameters_of
    from chaosgym.units import parse_option

    field, separator, value = text.partition("=")
    field = field_named(owner, field)
    if not separator or not field or not value:
        raise click.UsageError(f"--set {text!r} is not of the form FIELD=VALUE")
    described = parameters_of(owner).get(field)
    if described is None or described.choices:
        return field, value, ""
    unit = "" if described.unit == "-" else described.unit
    number = parse_option(field, value, described.unit, unit)
    bare = value.strip()
    doubt = millimetres_meant(field, bare, number, getattr(owner(), field)) if described.unit == "m" else ""
    return field, number, doubt
