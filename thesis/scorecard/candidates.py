"""Beams that a search found and that are not shipped: ``candidates.json``, with how each was found and judged."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from chaosgym.errors import DatasetError, ParameterError
from chaosgym.machines import ImpactBeam
from chaosgym.machines.parameters import parameters_of

KEPT = Path(__file__).with_name("candidates.json")

LARGEST_FILE = 1_000_000
"""Bytes beyond which a file is no candidate."""


@cache
def candidates() -> Mapping[str, Mapping[str, Any]]:
    """Candidates by name: how it was "found", its "parameters", and verdict and value of every statement, measured too.

    The journal of their search is ``candidates_journal.jsonl``: basin, generation, shares of the ranges, objective and
    costs of each candidate.
    """
    found: Mapping[str, Mapping[str, Any]] = json.loads(KEPT.read_text(encoding="utf-8"))
    return found


def read_candidate(name: str) -> ImpactBeam:
    """The beam of a candidate, by its name or from a file with "parameters", such as result.json of a search.

    Raises
    ------
    DatasetError
        If there is no such candidate or file, or the file holds none.
    ParameterError
        If a parameter is outside its range.
    """
    known = candidates()
    if name in known:
        return ImpactBeam(**known[name]["parameters"])
    path = Path(name)
    if not path.is_file():
        raise DatasetError(f"beam = {name!r} is neither a file nor one of {', '.join(known)}")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"it has more than {LARGEST_FILE} bytes")
        values = json.loads(path.read_text(encoding="utf-8"))["parameters"]
        unknown = sorted(set(values) - set(parameters_of(ImpactBeam())))
        if unknown:
            raise ValueError(f"{unknown[0]} is no parameter of the impact beam")
        return ImpactBeam(**values)
    except ParameterError:
        raise
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise DatasetError(f'{path} holds no beam: {error}; needed: an object with "parameters"') from error
