"""The page of the scorecard: one table a machine, misses shown like hits."""

from collections.abc import Mapping, Set

from chaosgym.machines import ImpactBeam
from thesis.scorecard.exclusions import known_exclusions
from thesis.scorecard.scorecard import Scorecard
from thesis.scorecard.verdicts import Judged
from thesis.statements import read_comparisons

HEAD = """# Scorecard: the thesis and the machines here

Written by `python -m thesis scorecard --markdown`. Each statement of the thesis about a simulation is computed from
one set of constants for each machine. *hit*: within the tolerance; *near*: within twice of it; *miss*: beyond, or a
wrong nature. Of several conditions the worst decides. What the text contradicts is not counted. Natures and forces
are those of one dot a cycle, as the thesis plots them: of the beam on one side of the bearing, the nearer one for a
single response; of the crank's joints the larger of both sides.

*Neighbours* are the share of machines that hit a statement with every constant that is not in print up to 1 % off,
at speeds up to half a step of the printed grid off, from another initial state. A *firm hit* is hit by at least half
of the neighbours; what few of them hit is luck.
What was tried: [calibration](calibration.md).
"""


def page(card: Scorecard) -> str:
    """Return the page of a scorecard as Markdown."""
    machines = dict.fromkeys(one.comparison.machine for one in card.judged)
    parts = [HEAD, *(_section(card, machine) for machine in machines), _tolerances(), _readings(), _left_out()]
    return "\n".join(parts)


def _section(card: Scorecard, machine: str) -> str:
    lines = [
        f"## {machine}\n",
        f"{_firm(card, machine)}\n",
        "| statement | figure | what | printed | here | verdict | neighbours | found |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [row(card, one) for one in card.judged if one.comparison.machine == machine]
    if machine == ImpactBeam.name:
        hit = {one.comparison.id for one in card.judged if one.verdict == "hit"}
        lines += ["", _exclusions(hit)]
    return "\n".join(lines) + "\n"


def _exclusions(hit: Set[str]) -> str:
    """Pairs of statements that no beam of the searches hits together, and those of which the shipped beam hits both."""
    found = known_exclusions()
    partners: dict[str, list[str]] = {}
    for pair in found.pairs:
        partners.setdefault(pair.one, []).append(pair.other)
    pairs = "; ".join(f"{one} with {', '.join(others)}" for one, others in partners.items())
    never = f"None hits {', '.join(found.never)}. " if found.never else ""
    both = ", ".join(f"{pair.one} with {pair.other}" for pair in found.pairs if {pair.one, pair.other} <= hit)
    return (
        f"### Exclusions\n\nOf {found.candidates} beams of the search without walls, most of them with a soft pivot "
        "and judged by quick runs, none hits both statements of these pairs, though by chance one or more would "
        f"(`python -m thesis exclusions` counts them): {pairs}. {never}The shipped beam, judged by thorough runs, hits "
        f"{both or 'no such pair'}."
    )


def _firm(card: Scorecard, machine: str) -> str:
    """What is known beside the bare hits, in words."""
    known, totals = card.firmness.get(machine), card.totals()[machine]
    hits, count = card.hit_rate(machine)
    bare = f"The machine itself hits {hits} of {count}."
    if known is None:
        return f"{bare} How firm they are is not known for these constants: `python -m thesis firmness`."
    mean, low, high = known.expected
    said = [
        f"Firm hits: {len(known.firm)} of {len(known.neighbours)}. A neighbour hits {mean:.1f} on average "
        f"({low:.1f} to {high:.1f} with 95 %, from {len(known.hits)} neighbours). {bare}"
    ]
    left_out = totals["left_out"]
    if left_out["total"]:
        said.append(f"Left out of the fit by figure: {left_out['hit']} of {left_out['total']}.")
    else:
        said.append("No figure was left out of the fit.")
    if known.exclusive:
        pairs = ", ".join(f"{one} with {other}" for one, other in known.exclusive)
        said.append(f"Hardly any candidate of the search hits both of these: {pairs}.")
    return " ".join(said)


def row(card: Scorecard, one: Judged) -> str:
    """Return one statement as a row of the table; a hit has a note only where the diagnosis says something else."""
    comparison, share = one.comparison, card.share(one)
    notes = one.notes if one.verdict != "hit" or "diagnosis" in one.notes else ""
    found = "; ".join(part for part in (comparison.contradictory, comparison.not_computed, notes) if part)
    what = comparison.statement.quantity.removesuffix(f": {str(comparison.printed).upper()}")
    return (
        f"| {comparison.id} | {comparison.statement.figure} | {what} "
        f"| {one.shown_printed} | {one.shown_value} | {one.verdict} "
        f"| {'-' if share is None else f'{share:.0%}'} | {found} |"
    )


def _tolerances() -> str:
    used = {one.tolerance.name: one.tolerance.reason for one in read_comparisons().compared}
    rows = "\n".join(f"| {name} | {reason} |" for name, reason in used.items())
    return f"## Tolerances\n\n| kind | a hit is within |\n|---|---|\n{rows}\n"


def _readings() -> str:
    known = read_comparisons()
    rows = _by_reason({one.id: one.reading for one in known.compared if one.reading})
    open_ones = "; ".join(f"`{name}` is {one.value:g}, {one.reason}" for name, one in known.unprinted.items())
    return (
        "## Readings\n\nDecided from the text, whatever the verdict.\n\n"
        f"| statements | text and decision |\n|---|---|\n{rows}\n\n"
        f"Not in print: {open_ones}.\n"
    )


def _left_out() -> str:
    rows = _by_reason(read_comparisons().out)
    return f"## Statements that are not compared\n\n| statements | why |\n|---|---|\n{rows}\n"


def _by_reason(reasons: Mapping[str, str]) -> str:
    """Rows of a table: the statements that share a reason, and the reason."""
    names: dict[str, list[str]] = {}
    for name, reason in reasons.items():
        names.setdefault(reason, []).append(name)
    return "\n".join(f"| {', '.join(shared)} | {reason} |" for reason, shared in names.items())
