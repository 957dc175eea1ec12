"""Check an entry for the table of results: a file of ``chaosgym compare`` and the policies that played in it.

Jobs that the file holds are played again by the policies' folders, and those of following the demand too. An entry
whose jobs come out otherwise is no entry: it was played by another policy, on another task or by another version.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.control.comparison import SUBJECTS, read_comparison
from chaosgym.control.controllers import Follow
from chaosgym.control.policies import load_policy
from chaosgym.control.rollout import Policy, play
from chaosgym.control.scores import ONE, ZERO, Scores, table_lines
from chaosgym.errors import DatasetError

FEWEST = 32
"""Machines of an entry; fewer leave intervals that tell nothing apart."""

SAME = 1e-6
"""Largest difference of two returns of the same job."""


def entry(path: Path, name: str, folders: Sequence[Path], again: int, fewest: int = FEWEST) -> dict[str, Any]:
    """Check the jobs of a contender; one folder for each seed, in the order of ``--policy``.

    Returns
    -------
    dict
        ``row`` as of ``Scores.row``, ``of`` the task, and ``again`` how many jobs were played again.

    Raises
    ------
    DatasetError
        If the file is no entry; says what is missing or which job came out otherwise.
    """
    table = read_comparison(path)
    of = (table.schema.metadata or {})[b"env"].decode()
    env, keywords = task_of(of)
    known = set(table["contender"].to_pylist())
    for needed in (ZERO, ONE, name):
        if needed not in known:
            raise DatasetError(f"{path} has no jobs of {needed!r}; it has those of {', '.join(sorted(known))}")
    scores = Scores(table)
    mine = scores.jobs(name)
    seeds = {len(returns) for returns in mine.values()}
    if seeds != {len(folders)}:
        raise DatasetError(
            f"{path} has {sorted(seeds)} seeds of {name!r}; give the folder of each, {len(folders)} were"
        )
    machines = sorted(mine)
    if machines != list(range(len(machines))) or len(machines) < fewest:
        raise DatasetError(
            f"{name!r} played {len(machines)} machines from number {machines[0]} on; an entry has all from 0 on, "
            f"{fewest} or more"
        )
    chosen = np.unique(np.linspace(0, len(machines) - 1, again).astype(int)).tolist()
    players: list[Policy] = [load_policy(folder) for folder in folders]
    for player, seed, found in [(Follow(), 0, scores.jobs(ZERO)), *((one, k, mine) for k, one in enumerate(players))]:
        who = ZERO if player not in players else f"{name!r}, seed {seed}"
        played = play(player, env, chosen, **keywords).returns
        for number, value in zip(chosen, played.tolist(), strict=True):
            if abs(value - found[number][seed]) > SAME:
                raise DatasetError(
                    f"{who} has {found[number][seed]:.6f} on machine {number}, and {value:.6f} when it plays again; "
                    "play the comparison anew with this version, on this computer"
                )
    return {"of": of, "name": name, "row": scores.row(name), "again": len(chosen)}


def task_of(subject: str) -> tuple[str, dict[str, Any]]:
    """Environment and keywords of a comparison's subject; the reverse of ``subject_of``."""
    env, *told = subject.split(", ")
    given = dict(one.split(" ", 1) for one in told)
    if "(" in env or not set(given) <= set(SUBJECTS):
        raise DatasetError(f"{subject} is no task of the table of results; allowed: an id, its level, split, objective")
    return env, {name: value if name != "sealed" else True for name, value in given.items()}


def lines(found: Mapping[str, Any]) -> list[str]:
    """What was checked, and the row of the table."""
    checked = f"{found['of']}: {found['again']} jobs of each seed came out the same"
    return [checked, *table_lines({found["name"]: found["row"]})]
