"""What lives beside a periodic motion: other motions, the speeds at which one falls into them, the smallest shock."""

from dataclasses import dataclass

from chaosgym.branches.stable_span import StableSpan, stable_span
from chaosgym.diagnosis.attractors import Attractors, attractors
from chaosgym.diagnosis.carried import carried_states
from chaosgym.diagnosis.push import Push, push_words, smallest_push
from chaosgym.diagnosis.shock import Shock, knock_words, smallest_shock
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.plain import Result


@dataclass(frozen=True, kw_only=True)
class Coexistence(Result):
    """The motions of a machine at its speed, and what leads from one to another.

    Attributes
    ----------
    machine
        At its speed.
    attractors
        Its motions, and how far was looked.
    spans
        Speeds over which each of them is stable, None for one without an orbit that is proven to attract; empty where
        there is one alone.
    shock
        The smallest knock that leaves the first, if it was asked for.
    push
        The push of least energy that leaves it, likewise; None also where every push is a knock.
    """

    shows = "stable_spans=spans shock push"

    machine: Machine
    attractors: Attractors
    spans: tuple[StableSpan | None, ...]
    shock: Shock | None
    push: Push | None

    @property
    def lines(self) -> list[str]:
        """Spans and shock for people."""
        unit = parameters_of(self.machine)[self.machine.speed_field].unit
        lines = [
            f"{'this motion' if not number else f'motion {number + 1}, {one.words},'} is {span.words(unit)}"
            for number, (one, span) in enumerate(zip(self.attractors.motions, self.spans, strict=False))
            if span
        ]
        lines += [self._shock_line(self.shock)] if self.shock else []
        return [*lines, *([self._push_line(self.push)] if self.push else [])]

    def _shock_line(self, shock: Shock) -> str:
        if shock.knock is None:
            turns = parameters_of(self.machine)[self.machine.clearance_field].unit == "rad"
            size = f"{shock.largest:.3g} rad/s" if turns else f"{1e3 * shock.largest:.3g} mm/s"
            return f"all of {shock.tried} knocks of up to {size} come back"
        other = "does not settle" if shock.leads_to is None else f"leads to motion {shock.leads_to + 1}"
        return f"smallest of {shock.tried} knocks that leaves: {knock_words(self.machine, shock.knock)}; it {other}"

    def _push_line(self, push: Push) -> str:
        if push.energy is None:
            return f"all of {push.tried} pushes in any direction of up to {1e3 * push.largest:.3g} mJ come back"
        other = "does not settle" if push.leads_to is None else f"leads to motion {push.leads_to + 1}"
        return (
            f"least of {push.tried} pushes in any direction that leaves: {push_words(self.machine, push)}; it {other}"
        )


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
        How many are tried for the smallest shock, and as many pushes in any direction; 0 for none.
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
    shock = smallest_shock(machine, found, knocks=knocks, workers=workers) if knocks else None
    several = found.motions if len(found.motions) > 1 else ()
    return Coexistence(
        machine=machine,
        attractors=found,
        spans=tuple(
            stable_span(machine, one.orbit) if one.orbit is not None and one.orbit.certified else None
            for one in several
        ),
        shock=shock,
        push=None if shock is None else smallest_push(machine, found, shock, pushes=knocks, workers=workers),
    )
