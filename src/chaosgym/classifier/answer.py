"""What does the classifier say of one response? A type and a nature with their probabilities, or why it says none."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Classification:
    """Answer for one machine or one record.

    Attributes
    ----------
    response_type, nature
        Most probable type (I, II, III) and nature; None if the classifier abstained.
    probabilities, nature_probabilities
        Of every type and nature; they sum to 1 in any case.
    confidence
        Probability of the most probable type.
    abstained, reason
        Whether the classifier refused to answer, and why; or how the answer came about.
    period
        Cycles after which a periodic response repeats; None if it is not periodic or not known.
    plausible_types
        Types that hold the truth with 90 % coverage.
    peak_force
        Predicted quantiles of the peak force of a settled cycle [N], by "5 %", "50 %", "95 %"; empty if not trained.
    """

    response_type: str | None
    nature: str | None
    probabilities: Mapping[str, float]
    nature_probabilities: Mapping[str, float]
    confidence: float
    abstained: bool
    reason: str
    period: int | None = None
    plausible_types: tuple[str, ...] = ()
    peak_force: Mapping[str, float] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "plausible_types": list(self.plausible_types)}
