r"""The thesis' guidelines as sentences on one machine: which case of 5.5.1 it is, signs of chaos, what 5.6 does next.

    Case I     all responses in the tolerances are periodic
    Case II    those that are not fill a part of the tolerances
    Case III   periodic and other responses are mixed

Case II holds throughout where no response of the tolerances is periodic. Mixed are they where no plane through the
tolerances parts them: the same rule that tells Type III from Type II (``chaosgym.diagnosis.type_rule``).
"""

from collections import Counter
from collections.abc import Sequence
from typing import Literal, NamedTuple

from chaosgym.design.methodology import Assessment
from chaosgym.design.texts import listed
from chaosgym.diagnosis import Neighbour, signs_of_chaos
from chaosgym.diagnosis.precursors import measured_rates
from chaosgym.diagnosis.type_rule import FORCE_CHANGE, mixed
from chaosgym.series import Type

Case = Literal["I", "II", "II throughout", "III", "undetermined"]


class Guideline(NamedTuple):
    """One sentence, and the section of the thesis that it follows."""

    section: str
    sentence: str


CASES: dict[Case, str] = {
    "I": "every response in the tolerances is periodic",
    "II": "responses that are not periodic fill a part of the tolerances, and are of Type III",
    "II throughout": "no response in the tolerances is periodic, and all are of Type III",
    "III": "periodic and other responses are mixed in the tolerances, so that all are of Type III, the periodic too",
    "undetermined": "the nominal response is undetermined, so that no case is told",
}

COEXISTING = "motions with forces more than 10 % apart coexist at the nominal machine, so that all are of Type III"
"""What the case becomes where an initial state decides."""

EVALUATION: dict[Type, str] = {
    "I": "the machine is judged by its predicted trend, taken to the unfavourable corner of the tolerances",
    "II": "the machine is judged by the worst case found in the tolerances",
    "III": "the machine is judged by statistics over all machines in the tolerances",
    "undetermined": "until the nominal response is told, statistics stand in and the verdict is open",
}
"""Phase VI of 5.6, by type."""


def case_of(assessed: Assessment, further: Sequence[Neighbour] = ()) -> Case:
    """Case of 5.5.1, over the machines of the series, the neighbourhood and those of ``further``.

    A machine that is undetermined is not known to be periodic, and counts as not periodic.

    Examples
    --------
    >>> from chaosgym.design import assess
    >>> from chaosgym.design.guidelines import case_of
    >>> case_of(assess(chaosgym.ImpactBeam(excitation_frequency=12.0), series_size=4))
    'I'
    """
    nature = assessed.nominal.nature
    if nature == "undetermined":
        return "undetermined"
    points = [*assessed.series.built, *further, *assessed.response.neighbours]
    region = [({}, nature), *((machine.shares, machine.nature) for machine in points)]
    calm = [shares for shares, kind in region if kind == "periodic"]
    restless = [shares for shares, kind in region if kind != "periodic"]
    if not restless:
        return "I"
    if not calm:
        return "II throughout"
    return "III" if mixed(restless, calm) else "II"


def guidelines(assessed: Assessment, further: Sequence[Neighbour] = ()) -> tuple[Guideline, ...]:
    """Sentences on one assessed machine, in the order of the thesis.

    Parameters
    ----------
    assessed
        What the methodology says of it.
    further
        More machines of its tolerances, as for ``assess``.

    Returns
    -------
    tuple of Guideline
        Signs of chaos at the nominal machine (5.3); the case and what it means for the types (5.5.1), both with how
        often each was right on the shipped dataset; the evaluation and the next step (5.6).

    Examples
    --------
    >>> from chaosgym.design import assess
    >>> from chaosgym.design.guidelines import guidelines
    >>> found = assess(chaosgym.ImpactBeam(excitation_frequency=12.0), series_size=4)
    >>> [one.section for one in guidelines(found)][-2:]
    ['5.6, phase VI', '5.6, phase VII']
    """
    said = [Guideline("5.3", sign.line) for sign in signs_of_chaos(assessed.response.centre)]
    case = case_of(assessed, further)
    machines = [*assessed.series.built, *further]
    sentence = CASES[case]
    if machines and case != "undetermined":
        counts = Counter(machine.nature for machine in machines)
        sentence += f" ({', '.join(f'{n} {nature}' for nature, n in counts.most_common())} of {len(machines)} machines)"
    if case != "undetermined":
        sentence += _held(case, assessed)
    said.append(Guideline("5.5.1", sentence))
    if assessed.response.coexists:
        said.append(Guideline("5.5.1", COEXISTING))
    elif case == "I":
        above = sum(machine.largest_peak > (1.0 + FORCE_CHANGE) * assessed.nominal.largest_peak for machine in machines)
        some = f"{len(machines) - above} are Type I and {above} Type II, with 10 % more force than the nominal one"
        outcome = "all are Type I" if not above else "all are Type II" if above == len(machines) else some
        said.append(Guideline("5.5.1", f"of the machines in the tolerances {outcome}"))
    said.append(Guideline("5.6, phase VI", EVALUATION["II" if assessed.response.coexists else assessed.type]))
    said.append(Guideline("5.6, phase VII", _next(assessed)))
    return tuple(said)


def _held(case: Case, assessed: Assessment) -> str:
    """How often the case of its neighbours gave the right nature of a point of the dataset."""
    rate = measured_rates().get(assessed.machine.name, {}).get(f"case {case}")
    if rate is None or rate.precision is None:
        return ""
    what = "periodic" if case == "I" else "not periodic"
    return f"; {rate.precision:.1%} of the dataset's points whose neighbours do so were {what} themselves"


def _next(assessed: Assessment) -> str:
    if assessed.verdict == "meets":
        return "the criteria are met: go on to the prototype stage, and measure there what was assumed"
    if assessed.verdict == "not judged":
        return "nothing is judged: state in [criteria] what the machine must reach, and assess it again"
    if assessed.verdict == "undetermined":
        return "the nominal response is undetermined: settle it by more cycles or by other nominal values, then go on"
    missed = [check.name for check in assessed.checks if not check.met]
    return f"{listed(missed)} missed: change the machine, and assess it again"
