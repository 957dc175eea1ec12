"""The command ``diagnose``: is a machine's response periodic or chaotic, of which type, and how far from losing it?"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.options import FORCE_ERROR, FloatRange, IntRange
from chaosgym.cli.output import (
    DIAGNOSED,
    announce,
    emit,
    force_line,
    patience,
    picture_path,
    plot_option,
    verdict_lines,
)

if TYPE_CHECKING:
    from chaosgym.branches.margins import Margins
    from chaosgym.diagnosis.attractors import Attractors
    from chaosgym.diagnosis.response_type import ResponseType
    from chaosgym.diagnosis.verdict import MachineDiagnosis

Part = tuple[dict[str, Any], list[str]]
"""Values for JSON, and lines for people."""


@machine_command(chooses="point")
@click.option(
    "--test",
    type=click.Choice(["adaptive", "two-step", "mut"]),
    default="adaptive",
    show_default=True,
    help="All tests in stages, or the Two-Step Test or the Matrix Update Test alone.",
)
@click.option("--budget", type=IntRange(100, 10**7), default=3200, show_default=True, help="Cycles at the most.")
@click.option("--types", is_flag=True, help="Also tell the response type (I, II, III) over the tolerances.")
@click.option("--margins", is_flag=True, help="Also tell how far each tolerance is from a loss of stability.")
@click.option(
    "--reach",
    type=FloatRange(0.0, 10.0, min_open=True),
    default=1.0,
    show_default=True,
    help="Tolerances up to which margins are looked for.",
)
@click.option(
    "--kicks", type=IntRange(1, 10**5), help="Also try so many knocks, for the smallest that leaves; and margins."
)
@FORCE_ERROR
@plot_option()
def diagnose(
    machine: Any,
    test: str,
    budget: int,
    types: bool,
    margins: bool,
    reach: float,
    kicks: int | None,
    sensor_error: float | None,
    plot: str | None,
    as_json: bool,
) -> None:
    """Tell whether a machine's response is periodic or chaotic, by simulation."""
    picture = picture_path(plot, f"diagnose-{machine.name}")
    error = sensor_error or 0.0
    if (types or margins or kicks) and test != "adaptive":
        raise click.UsageError(f"--types, --margins and --kicks go with --test adaptive, not with {test}")
    if test != "mut":
        announce("diagnose", machine, DIAGNOSED * budget)
    with patience("diagnose"):
        verdict = _verdict(machine, test, budget, error)
        response = _response(machine, verdict, budget, error) if types else None
        verdict, motions = _with_other_motions(machine, verdict, response, budget if margins or kicks else 0)
        parts = [_settled_part(machine, verdict, test)]
        if types or margins or kicks:
            parts.append(({"attractors": None if motions is None else motions.as_dict()}, []))
        if response is not None:
            parts.append(_type_part(response))
        if margins or kicks:
            parts.append(_margin_part(machine, verdict, reach))
        if motions is not None:
            parts.append(_beside_part(machine, verdict, motions, kicks or 0))
    result = {name: value for values, _ in parts for name, value in values.items()}
    emit(
        result,
        as_json,
        lambda: [line for _, lines in parts for line in lines],
        picture,
        lambda plots: plots.diagnosis_figure(verdict),
    )


def _verdict(machine: Any, test: str, budget: int, sensor_error: float) -> "MachineDiagnosis":
    """The verdict of one test, or of all in stages; a simulation from rest each."""
    from chaosgym import diagnosis
    from chaosgym.diagnosis.verdict import of_machine
    from chaosgym.series import two_step_test
    from chaosgym.simulation import simulate

    if test == "two-step":
        record = simulate(machine, budget)
        return of_machine(two_step_test(record, sensor_error=sensor_error), record=record)
    if test == "mut":
        return diagnosis.matrix_update_test(machine)
    return diagnosis.diagnose(machine, budget=budget, sensor_error=sensor_error)


def _settled_part(machine: Any, verdict: "MachineDiagnosis", test: str) -> Part:
    """The verdict and the forces, and what only all tests tell: cycles, votes, signs of chaos."""
    from chaosgym.diagnosis import signs_of_chaos

    values, forces = _forces(machine, verdict)
    subject = machine.name + {"two-step": ", Two-Step Test", "mut": ", Matrix Update Test"}.get(test, "")
    lines = verdict_lines(subject, verdict, forces)
    result = {"machine": machine.name, **verdict.as_dict(), **values, "warnings": []}
    if test != "adaptive":
        section = verdict.evidence.get("section")
        return result, [*lines, *([f"  section: {section}"] if section else [])]
    exponent = verdict.evidence["largest_lyapunov_exponent_per_cycle"]
    signs = signs_of_chaos(verdict)
    no_contact = [] if verdict.judged.peak_force.any() else ["no contact at all: the gap is never closed"]
    doubts = [verdict.reason] if verdict.status in ("disputed", "unresolved") else []
    cycles = verdict.evidence["cycles_used"]
    result |= {
        "largest_lyapunov_exponent_per_cycle": {key: exponent[key] for key in ("value", "standard_error")},
        "cycles_used": cycles,
        "warnings": [*doubts, *no_contact],
        "signs_of_chaos": [sign.as_dict() for sign in signs],
    }
    votes = ", ".join(f"{test} {vote}" for test, vote in verdict.votes.items())
    more = [f"{cycles} cycles used; votes: {votes}", *(sign.line for sign in signs), *no_contact]
    return result, [*lines, *(f"  {line}" for line in more)]


def _forces(machine: Any, verdict: "MachineDiagnosis") -> Part:
    """Settled peak forces of every surface, and the largest of the transient."""
    from chaosgym.numbers import summary

    settled, before = verdict.judged.peak_force, verdict.transient_run.peak_force
    shown = machine.sides[verdict.judged.worst_side]
    surfaces = {side: summary(settled[:, place]) for side, place in machine.surfaces.items()}
    transient = {side: float(before[:, place].max()) for side, place in machine.surfaces.items()}
    values = {
        "peak_force_summary_N": surfaces[shown],
        "worst_surface": shown,
        "surfaces_peak_force_N": surfaces,
        "transient_largest_peak_force_N": transient,
    }
    touched = {side: forces for side, forces in surfaces.items() if forces["max"] > 0.0}
    lines = [f"{side}: {force_line(forces)}" for side, forces in touched.items()]
    largest = max(surfaces, key=lambda side: surfaces[side]["max"])
    if surfaces[shown]["max"] < (1.0 - 1e-9) * surfaces[largest]["max"]:
        lines.append(f"monitored: {shown}; the largest force is on {largest}, {surfaces[largest]['max']:.2f} N")
    elif min(one["max"] for one in surfaces.values()) < (1.0 - 1e-9) * surfaces[shown]["max"] and len(touched) > 1:
        lines.append(f"worst surface: {shown}, {surfaces[shown]['max']:.2f} N")
    if 0 < len(touched) < len(surfaces):
        lines.append(f"never touched once settled: {', '.join(side for side in surfaces if side not in touched)}")
    lines.append("transient: up to " + ", ".join(f"{peak:.2f} N {side}" for side, peak in transient.items()))
    return values, lines


def _response(machine: Any, verdict: "MachineDiagnosis", budget: int, sensor_error: float) -> "ResponseType":
    from chaosgym.diagnosis import response_type

    return response_type(machine, budget=budget, sensor_error=sensor_error, centre=verdict)


def _with_other_motions(
    machine: Any, verdict: "MachineDiagnosis", response: "ResponseType | None", budget: int
) -> "tuple[MachineDiagnosis, Attractors | None]":
    """The verdict with the other motions of the machine, where its type or its margins ask for them.

    ``budget`` are cycles of a search for margins; 0 for none.
    """
    if response is not None:
        return response.centre, response.attractors
    if not budget or verdict.nature != "periodic":
        return verdict, None
    from chaosgym.diagnosis import attractors
    from chaosgym.diagnosis.carried import carried_states

    motions = attractors(machine, budget=budget, centre=verdict, carried=carried_states(machine))
    return motions.told_of(verdict), motions


def _type_part(response: "ResponseType") -> Part:
    values = {"response_type": response.type, "response_type_reason": response.reason}
    return values, [f"  Type {response.type}: {response.reason}", f"    means: {response.meaning}"]


def _margin_part(machine: Any, verdict: "MachineDiagnosis", reach: float) -> Part:
    """The margins of a certified orbit, or why there are none."""
    from chaosgym.branches.margins import margins_of

    margins = margins_of(machine, verdict, reach=reach)
    if margins is None:
        why = f"no margins: they need an orbit that is proven to attract, this response is {verdict.words}"
        return {"margins": None}, [f"  {why}"]
    lines = [
        f"largest multiplier {margins.largest_multiplier:.3g}; stability ends, in tolerances:",
        *(f"  {line}" for line in _margin_lines(machine, margins, reach)),
    ]
    return {"margins": margins.as_dict()}, [f"  {line}" for line in lines]


def _beside_part(machine: Any, verdict: "MachineDiagnosis", motions: "Attractors", knocks: int) -> Part:
    """Where each of several motions is stable along the speed, and the smallest knock that leaves a proven one."""
    from chaosgym.branches.coexistence import coexistence

    proven = verdict.orbit is not None and verdict.orbit.certified
    beside = coexistence(machine, verdict, motions, knocks=knocks if proven else 0)
    return {"coexistence": beside.as_dict()}, [f"  {line}" for line in beside.lines]


def _margin_lines(machine: Any, margins: "Margins", reach: float) -> Iterable[str]:
    by_field: dict[str, list[str]] = {}
    for margin in margins.margins:
        sign, nominal = "-" if margin.side < 0 else "+", getattr(machine, margin.parameter)
        change = f" ({margin.value / nominal - 1.0:+.2%})" if nominal else ""
        if margin.kind is not None:
            text = f"{sign}{margin.share:.2f} {margin.kind} at {margin.value:.8g}{change}"
        else:
            text = f"{sign}{margin.share:.2f} {margin.end}" if margin.end else f"{sign} none within {reach:g}"
        by_field.setdefault(margin.parameter, []).append(text)
    return [f"{name:22s} {'; '.join(texts)}" for name, texts in by_field.items()]
