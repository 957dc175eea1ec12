"""How far the classifier for machines without one of their own holds: against the full diagnosis, on random points."""

from collections.abc import Sequence
from typing import Any

from tqdm import tqdm

from chaosgym.classifier import classifier_for
from chaosgym.diagnosis import diagnose
from chaosgym.machines import Machine


def general(machines: Sequence[Machine], *, progress: bool = False) -> dict[str, Any]:
    """Counts of points of one machine: proven, learned, not answered, each with those that the diagnosis contradicts.

    Points that the diagnosis leaves undetermined are counted apart, and so are those that it calls chaotic because of
    chaos that dies out, on an orbit that is proven here.
    """
    classifier = classifier_for(machines[0])
    counts = dict.fromkeys(
        ("proven", "proven wrong", "chaos dies out", "learned", "learned wrong", "not answered", "undetermined"), 0
    )
    for machine in tqdm(machines, desc="classify", unit="point", disable=not progress):
        answer = classifier.classify(machine, types=False).centre
        truth = diagnose(machine).labelled("thesis")
        if truth.nature == "undetermined":
            counts["undetermined"] += 1
        elif answer.proven and truth.status == "transient":
            counts["chaos dies out"] += 1
        elif answer.nature is None:
            counts["not answered"] += 1
        else:
            how = "proven" if answer.proven else "learned"
            counts[how] += 1
            counts[f"{how} wrong"] += answer.nature != truth.nature
    return {"machine": machines[0].name, "points": len(machines), **counts}
