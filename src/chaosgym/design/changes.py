"""Changes of a machine: which are worth trying, what lies between them, and what they cost.

The cost of changing a field from a to b is its weight times |ln(b / a)|, so that halving costs as much as doubling;
changes of several fields add up. From zero to b it is ln(1 + |b| / s), where s is the equivalent force for a force, and
the clearance for a length.
"""

import math
from collections.abc import Container, Iterable, Mapping

from chaosgym.diagnosis import default_tolerances
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import is_half_play, parameters_of, quantity_of, with_settings

SECTION_FIELDS = ("height", "rod_diameter", "frequency_factor")
"""Fields that make a member stiffer."""

MASS_FIELDS = ("slider_mass", "yoke_mass")
"""Fields that make a moving part lighter."""

STEPS = 3
"""Values between the nominal one and the outermost one of a field that are screened."""

SAME = 6e-4
"""Share of a value by which a candidate, rounded to four digits, may miss the nominal one that it stands for."""


def default_changes(machine: Machine) -> dict[str, tuple[float, ...]]:
    """Values worth trying, by field: less clearance, more damping, other speed, stiffer member, softer contact, less
    mass, more preload. Without values, as for a preload of zero, the search finds its own.
    """
    known = parameters_of(machine)
    factors: dict[str, tuple[float, ...]] = {machine.clearance_field: (0.75, 0.5, 0.25)}
    factors |= {name: (2.0, 4.0) for name in default_tolerances(machine) if "damping" in name}
    factors[machine.speed_field] = (0.8, 0.9, 1.1)
    factors |= {name: (1.1, 1.25) for name in SECTION_FIELDS if name in known}
    factors |= {name: (0.5,) for name in known if _of_contact(name, known) and getattr(machine, name) > 0.0}
    factors |= {name: (0.8,) for name in MASS_FIELDS if name in known}
    factors |= {name: (1.5, 2.0) for name in known if name.endswith("preload")}
    return {
        name: tuple(_rounded(getattr(machine, name) * factor, 4) for factor in row if getattr(machine, name))
        for name, row in factors.items()
    }


def value_text(machine: Machine, name: str) -> str:
    """A changed value with its unit, and what it asks of a part where the field alone does not say.

    Examples
    --------
    >>> value_text(chaosgym.ImpactBeam(height=0.012), "height")
    '12 mm'
    >>> value_text(chaosgym.ImpactBeam(clearance=1e-4), "clearance")
    '0.1 mm (half of the play)'
    """
    value, told = getattr(machine, name), quantity_of(machine, name)
    if is_half_play(machine, name):
        return f"{told} (half of the play)"
    asks = {
        "frequency_factor": f"the structure {value**2:.3g} times as stiff, its mass as it is",
        "damping_factor": f"{value:.3g} times the damping of the structure",
        "lower_stiffness_factor": f"the lower stop {value:.3g} times as stiff as the upper one",
        "lower_damping_factor": f"the lower stop with {value:.3g} times the damping of the upper one",
        "drive_level": f"{value:.3g} times the force or motion of the drive",
    }
    return f"{told} ({asks[name]})" if name in asks else told


def _of_contact(name: str, known: Container[str]) -> bool:
    """Whether a field is the stiffness of a contact."""
    return name == "contact_stiffness" or (name.endswith("_stiffness") and f"{name[:-10]}_clearance" in known)


def change_cost(
    machine: Machine,
    changes: Mapping[str, float],
    weights: Mapping[str, float] | None = None,
    force: float = 0.0,
) -> float:
    """Cost of a set of changes: the sum of weight times |ln(new / old)|; a weight is 1 unless given.

    Parameters
    ----------
    machine
        The nominal machine.
    changes
        New values by field.
    weights
        By field.
    force
        Equivalent force [N], beside which a force is weighed that is zero in one of the machines.

    Raises
    ------
    ParameterError
        If a change to or from zero, or below it, is of a field that is neither a force nor a length.

    Examples
    --------
    >>> from chaosgym.machines import ImpactBeam
    >>> round(change_cost(ImpactBeam(clearance=2e-4), {"clearance": 1e-4}), 4)
    0.6931
    """
    weights = weights or {}
    total = 0.0
    for name, value in changes.items():
        nominal = getattr(machine, name)
        if nominal > 0.0 and value > 0.0:
            size = abs(math.log(value / nominal))
        else:
            scales = {"N": force, "m": float(getattr(machine, machine.clearance_field))}
            scale = scales.get(parameters_of(machine)[name].unit, 0.0)
            if not scale > 0.0:
                raise ParameterError(f"{name}: the cost of a change from {nominal:g} to {value:g} needs values above 0")
            size = math.log1p(abs(value - nominal) / scale)
        total += weights.get(name, 1.0) * size
    return total


def allowed(machine: Machine, change: Mapping[str, float], force: float) -> bool:
    """Whether a machine with the change is allowed and has a cost; an unknown field is an error."""
    for name in change:
        if name not in parameters_of(machine):
            with_settings(machine, change)
    try:
        with_settings(machine, change)
        change_cost(machine, change, None, force)
    except ParameterError:
        return False
    return True


def differing(machine: Machine, change: Mapping[str, float]) -> dict[str, float]:
    """The fields of a candidate that differ from the nominal ones by more than their rounding."""
    return {
        name: value
        for name, value in change.items()
        if not math.isclose(value, getattr(machine, name, math.nan), rel_tol=SAME)
    }


def between(machine: Machine, values: Mapping[str, tuple[float, ...]], force: float) -> Iterable[dict[str, float]]:
    """Values between the nominal one and the outermost ones stated; without any, a range of its own."""
    for name, row in values.items():
        nominal = getattr(machine, name)
        ends = [value for value in (min(row, default=nominal), max(row, default=nominal)) if value != nominal]
        if not ends:
            ends = [0.5 * nominal, 2.0 * nominal] if nominal else [-2.0 * force, 2.0 * force]
        for end in ends:
            for k in range(1, STEPS + 1):
                yield {name: part_of(nominal, end, k / (STEPS + bool(row)))}


def distinct(changes: Iterable[Mapping[str, float]], known: Iterable[Mapping[str, float]]) -> list[Mapping[str, float]]:
    """Changes without repetition, and without those that are known."""
    seen = {tuple(sorted(one.items())) for one in known}
    kept = {tuple(sorted(one.items())): one for one in changes}
    return [one for key, one in kept.items() if key not in seen]


def part_of(nominal: float, value: float, share: float) -> float:
    """A share of the way to a changed value: in the logarithm where both are above zero."""
    if nominal > 0.0 and value > 0.0:
        return _rounded(nominal * (value / nominal) ** share)
    return _rounded(nominal + share * (value - nominal))


def _rounded(value: float, digits: int = 3) -> float:
    """A change is an engineering figure."""
    return float(f"{value:.{digits}g}")
