"""Do sampled response types and margins agree? Random machines, each disagreement looked at by a finer neighbourhood.

A type (``type_rule``) looks at some points of the region of speed and clearance, each from rest. A margin follows the
motion itself along either and asks whether it keeps its stability throughout. They part in two ways:

    Type I, but stability ends within a tolerance       what do 20 points a side say, from rest?
    not Type I, but stability ends nowhere              what do the same points say from the motion's own state?
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.branches.margins import margins_of
from chaosgym.diagnosis import Neighbour, default_tolerances, diagnose, judge_type, response_type
from chaosgym.errors import ChaosgymError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings

FINE = 20
"""Points a side of the finer neighbourhood."""

BUDGET = 800
"""Cycles of each diagnosis."""


def compared(machine: Machine) -> dict[str, Any]:
    """What type and margins say of a machine, and what a finer neighbourhood says where they part."""
    centre = diagnose(machine, budget=BUDGET)
    both = (machine.speed_field, machine.clearance_field)
    tolerances = {name: one for name, one in default_tolerances(machine).items() if name in both}
    found = margins_of(machine, centre, tolerances)
    if found is None:
        return {"outcome": f"left out: {centre.nature}, {centre.status}"}
    kind = response_type(
        machine, tolerances, window="speed-clearance", initial_states=1, budget=BUDGET, centre=centre, workers=1
    )
    lost = found.nearest
    told = {
        "type": kind.type,
        "reason": kind.reason,
        "share": None if lost is None else lost.share,
        "kind": None if lost is None else lost.kind,
        "not_followed": [margin.end for margin in found.margins if margin.end],
    }
    if lost is None and told["not_followed"]:
        return {"outcome": "margin not followed to its end", **told}
    if (kind.type == "I") == (lost is None):
        return {"outcome": f"agree: {'Type I, none' if lost is None else 'not Type I, stability ends'}", **told}
    start = centre.evidence["final_state"] if lost is None else None
    neighbours = []
    for name, tolerance in tolerances.items():
        for share in np.delete(np.arange(-FINE, FINE + 1), FINE) / FINE:
            other = with_settings(machine, {name: tolerance.at(getattr(machine, name), float(share))})
            run = diagnose(other, budget=BUDGET, initial_state=start)
            neighbours.append(Neighbour({name: float(share)}, run.nature, run.evidence["largest_peak"]))
    finer, why = judge_type(centre.nature, centre.evidence["largest_peak"], neighbours)
    told |= {"finer": finer, "finer_reason": why}
    if lost is not None:
        alike = "the motion beyond is alike" if finer == "I" else f"luck: a finer sample says Type {finer}"
        return {"outcome": f"Type I, but stability ends: {alike}", **told}
    if finer == "I":
        return {
            "outcome": "not Type I, stability ends nowhere: rest, or both parameters at once, lead to another motion",
            **told,
        }
    rises = "peak force" in why
    return {"outcome": f"not Type I, stability ends nowhere: {'the force rises' if rises else why}", **told}


def types_and_margins(machines: Sequence[Machine], *, progress: bool = False) -> dict[str, Any]:
    """How often types and margins agree, and a row for each machine."""
    rows = []
    for number, machine in enumerate(tqdm(machines, desc="machines", disable=not progress)):
        try:
            rows.append({"number": number, **compared(machine)})
        except ChaosgymError as error:
            rows.append({"number": number, "outcome": f"failed: {error}"})
    return {"counts": dict(Counter(row["outcome"] for row in rows).most_common()), "rows": rows}
