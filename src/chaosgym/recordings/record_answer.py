"""What is learned from machines, asked about a record: irregularity and nature, and what a verdict leaves of both."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from chaosgym.plain import Result
from chaosgym.series import Diagnosis


@dataclass(frozen=True, kw_only=True)
class RecordAnswer(Result):
    """Answer for one record of peak forces.

    Attributes
    ----------
    irregular
        Whether the settled response scatters by more than the sensor's error, whatever its period up to 16 cycles:
        what a sensor can know. None if the error is not stated, or it is too close to call.
    irregular_probability
        None if the error is not stated.
    amplitude
        By how much the record does not repeat [N]: scatter within the classes of the best period, as the half range of
        an even spread; the sensor's error is part of it.
    nature, nature_probabilities
        The exact nature, which a sensor can see only where the irregularity exceeds its error; None if too close to
        call.
    period
        Cycles after which a regular record repeats; None otherwise.
    plausible
        Natures that hold the truth with 90 % coverage, whichever it is.
    abstained, reason
        Whether neither question is answered, and why.
    warning
        What the record contradicts, such as the stated error; empty if nothing.
    """

    irregular: bool | None
    irregular_probability: float | None
    amplitude: float | None
    nature: str | None
    nature_probabilities: Mapping[str, float]
    period: int | None
    plausible: tuple[str, ...]
    abstained: bool
    reason: str
    warning: str = ""

    def under(self, verdict: Diagnosis) -> "RecordAnswer":
        """Return the answer under the verdict of ``chaosgym.judge_peaks`` on the same record, which decides.

        The classifier has learned from machines alone and takes many random records for chaos. Its probabilities stand
        where it names the nature of the verdict and holds it plausible; elsewhere ``reason`` says why there are none.
        Then it has abstained where the verdict is undetermined. What it says of irregularity falls where the verdict
        contradicts.

        Examples
        --------
        >>> import numpy as np
        >>> peaks = 100.0 + 6.0 * np.random.default_rng(0).normal(size=300)  # white noise
        >>> learned = chaosgym.default_classifier("impact-beam").classify_record(peaks)
        >>> learned.nature, learned.under(chaosgym.judge_peaks(peaks).diagnosis).nature
        ('chaotic', 'undetermined')
        """
        answer = self
        if self.irregular is (verdict.nature == "periodic") and not verdict.condition:
            answer = replace(answer, irregular=None, irregular_probability=None)
        if self.nature != verdict.nature or verdict.nature not in self.plausible:
            why = self.reason
            if self.nature is not None:
                undecided = verdict.nature == "undetermined"
                why = f"the verdict {'is undetermined' if undecided else 'contradicts what is learned'}"
            answer = replace(answer, nature_probabilities={}, plausible=(), reason=why or "too close to call")
        return replace(answer, nature=verdict.nature, period=verdict.period, abstained=verdict.nature == "undetermined")
