"""Numbers of a report as texts for people: what is printed, and what the page shows."""

import math
from collections.abc import Sequence

NOT_ASKED = "not asked"
"""What stands in place of a number that no criterion gives."""


def hours_text(value: float) -> str:
    """Hours of operation, in four digits.

    Examples
    --------
    >>> hours_text(87600.4), hours_text(float("inf"))
    ('87,600 h', 'without end')
    """
    return f"{life_text(value)} h" if math.isfinite(value) else life_text(value)


def life_text(value: float) -> str:
    """A life in any unit, in four digits.

    Examples
    --------
    >>> life_text(260486.0), life_text(23.05), life_text(float("nan"))
    ('260,500', '23.05', 'not asked')
    """
    if math.isnan(value):
        return NOT_ASKED
    if not math.isfinite(value):
        return "without end"
    return f"{float(f'{value:.4g}'):,.0f}" if value >= 1000.0 else f"{value:.4g}"


def share_text(value: float) -> str:
    """Probability with as many nines as it has.

    Examples
    --------
    >>> share_text(0.99987), share_text(7.6e-12), share_text(1.0)
    ('0.99987', '0.0000', '1.0000')
    """
    if math.isnan(value):
        return NOT_ASKED
    if value >= 1.0 - 1e-9:
        return "1.0000" if value == 1.0 else "> 0.99999999"
    digits = max(4, math.ceil(-math.log10(1.0 - value)) + 1) if value > 0.0 else 4
    return f"{value:.{min(digits, 9)}f}"


def percent_text(value: float) -> str:
    """Share in whole percents."""
    return NOT_ASKED if math.isnan(value) else f"{100.0 * value:.0f} %"


def number_text(value: float) -> str:
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
    "fatigue life": life_text,
    "bending life": life_text,
    "wear life": life_text,
    "reliability": share_text,
    "safety factor": number_text,
    "machines that meet": percent_text,
}
"""How the value of each criterion is told."""
