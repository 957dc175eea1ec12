"""Numbers of a report as texts for people: what is printed, and what the page shows."""

import math
from collections.abc import Sequence

NOT_ASKED = "not asked"
"""What stands in place of a number that no criterion gives."""


def hours_told(value: float) -> str:
    """Hours of operation, in four digits.

    Examples
    --------
    >>> hours_told(87600.4), hours_told(float("inf"))
    ('87,600 h', 'without end')
    """
    return f"{life_told(value)} h" if math.isfinite(value) else life_told(value)


def life_told(value: float) -> str:
    """A life in any unit, in four digits.

    Examples
    --------
    >>> life_told(260486.0), life_told(23.05), life_told(float("nan"))
    ('260,500', '23.05', 'not asked')
    """
    if math.isnan(value):
        return NOT_ASKED
    if not math.isfinite(value):
        return "without end"
    return f"{float(f'{value:.4g}'):,.0f}" if value >= 1000.0 else f"{value:.4g}"


def share_told(value: float) -> str:
    """Probability with as many nines as it has.

    Examples
    --------
    >>> share_told(0.99987), share_told(7.6e-12), share_told(1.0)
    ('0.99987', '0.0000', '1.0000')
    """
    if math.isnan(value):
        return NOT_ASKED
    if value >= 1.0 - 1e-9:
        return "1.0000" if value == 1.0 else "> 0.99999999"
    digits = max(4, math.ceil(-math.log10(1.0 - value)) + 1) if value > 0.0 else 4
    return f"{value:.{min(digits, 9)}f}"


def percent_told(value: float) -> str:
    """Share in whole percents."""
    return NOT_ASKED if math.isnan(value) else f"{100.0 * value:.0f} %"


def number_told(value: float) -> str:
    """A figure of three digits; without contact a safety factor has none."""
    return NOT_ASKED if math.isnan(value) else f"{value:.3g}" if math.isfinite(value) else "no contact"


def listed(names: Sequence[str]) -> str:
    """Names in a sentence.

    Examples
    --------
    >>> listed(["life"]), listed(["life", "reliability", "safety factor"])
    ('life', 'life, reliability and safety factor')
    """
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


CRITERIA = {
    "fatigue life": life_told,
    "bending life": life_told,
    "wear life": life_told,
    "reliability": share_told,
    "safety factor": number_told,
    "machines that meet": percent_told,
}
"""How the value of each criterion is told."""
