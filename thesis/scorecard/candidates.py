"""Machines that a search found and that are not shipped: ``candidates.json``, with how each was found and judged."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from chaosgym.errors import DatasetError, ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of, with_settings
from thesis.scorecard.evaluation import THESIS_MACHINES

KEPT = Path(__file__).with_name("candidates.json")

LARGEST_FILE = 1_000_000
"""Bytes beyond which a file is no candidate."""


class Candidate(NamedTuple):
    """A machine that a search found, and what it found of conditions that are not in print, by name."""

    machine: Machine
    unprinted: Mapping[str, float]


@cache
def candidates() -> Mapping[str, Mapping[str, Any]]:
    """Candidates by name: how it was "found", its "parameters", and verdict and value of every statement, measured too.

    A candidate is a beam unless it names another "machine". The journal of the beams' search is
    ``candidates_journal.jsonl``: basin, generation, shares of the ranges, objective and costs of each candidate.
    """
    found: Mapping[str, Mapping[str, Any]] = json.loads(KEPT.read_text(encoding="utf-8"))
    return found


def read_candidate(name: str) -> Candidate:
    """A candidate by its name, or from a file with "parameters", such as result.json of a search.

    Raises
    ------
    DatasetError
        If there is no such candidate or file, or the file holds none.
    ParameterError
        If a parameter is outside its range.
    """
    known = candidates()
    if name in known:
        return _candidate(known[name])
    path = Path(name)
    if not path.is_file():
        raise DatasetError(f"candidate = {name!r} is neither a file nor one of {', '.join(known)}")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"it has more than {LARGEST_FILE} bytes")
        return _candidate(json.loads(path.read_text(encoding="utf-8")))
    except ParameterError:
        raise
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DatasetError(f'{path} holds no candidate: {error}; needed: an object with "parameters"') from error


def _candidate(told: Mapping[str, Any]) -> Candidate:
    """The thesis' machine with these parameters."""
    base = THESIS_MACHINES[told.get("machine", "impact-beam")]
    unknown = sorted(set(told["parameters"]) - set(parameters_of(base)))
    if unknown:
        raise ValueError(f"{unknown[0]} is no parameter of the {base.name}")
    conditions = {str(name): float(value) for name, value in told.get("unprinted", {}).items()}
    return Candidate(with_settings(base, told["parameters"]), conditions)
