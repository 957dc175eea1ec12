"""What lives beside a periodic motion: other motions, the speeds at which one falls into them, the smallest shock."""

from dataclasses import dataclass
from typing import Any

from chaosgym.branches.stable_span import StableSpan, stable_span
from chaosgym.diagnosis.attractors import Attractors, attractors
from chaosgym.diagnosis.carried import carried_states
from chaosgym.diagnosis.shock import Shock, knock_words, smallest_shock
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of


@dataclass(frozen=True, kw_only=True)
class Coexistence:
    """The motions of a machine at its speed, and what leads from one to another.

    Attributes
    ----------
    machine
        At its speed.
    attractors
        Its motions, and how far was looked.
    spans
        Speeds over which each of them is stable, None for one without a proven orbit; empty where there is one alone.
    shock
        The smallest knock that leaves the first, if it was asked for.
    """

    machine: Machine
    attractors: Attractors
    spans: tuple[StableSpan | None, ...]
    shock: Shock | None

    @property
    def lines(self) -> list[str]:
        """Spans and shock for people."""
        unit = parameters_of(self.machine)[self.machine.speed_field].unit
        lines = [
            f"{'this motion' if not number else f'motion {number + 1}, {one.words},'} is {span.words(unit)}"
            for number, (one, span) in enumerate(zip(self.attractors.motions, self.spans, strict=False))
            if span
        ]
        return [*lines, *([self._shock_line(self.shock)] if self.shock else [])]

    def _shock_line(self, shock: Shock) -> str:
        if shock.knock is None:
            turns = parameters_of(self.machine)[self.machine.clearance_field].unit == "rad"
            size = f"{shock.largest:.3g} rad/s" if turns else f"{1e3 * shock.largest:.3g} mm/s"
            return f"all of {shock.tried} knocks of up to {size} come back"
        other = "does not settle" if shock.leads_to is None else f"leads to motion {shock.leads_to + 1}"
        return f"smallest of {shock.tried} knocks that leaves: {knock_words(self.machine, shock.knock)}; it {other}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        shock = self.shock
        return {
            "stable_spans": [None if span is None else span.as_dict() for span in self.spans],
            "shock": None
            if shock is None
            else {**shock._asdict(), "knock": None if shock.knock is None else shock.knock._asdict()},
        }


def coexistence(
    machine: Machine,
    verdict: MachineDiagnosis,
    found: Attractors | None = None,
    *,
    knocks: int = 0,
    workers: int | None = None,
) -> Coexistence:
    """Look for other motions, follow each along the speed to where its stability ends, and try knocks.

    Parameters
    ----------
    machine
        What runs.
    verdict
        ``diagnose(machine)``.
    found
        Its motions, if they are known.
    knocks
        How many are tried for the smallest shock; 0 for none.
    workers
        Number of threads; all processors by default.

    Examples
    --------
    >>> from chaosgym.branches.coexistence import coexistence
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> coexistence(beam, chaosgym.diagnose(beam)).spans  # no other motion
    ()
    """
    found = found or attractors(machine, centre=verdict, carried=carried_states(machine), workers=workers)
    several = found.motions if len(found.motions) > 1 else ()
    return Coexistence(
        machine=machine,
        attractors=found,
        spans=tuple(None if one.orbit is None else stable_span(machine, one.orbit) for one in several),
        shock=smallest_shock(machine, found, knocks=knocks, workers=workers) if knocks else None,
    )
