"""Comparison of controllers and policies: all play the same machines, demands and disturbances, and jobs are kept."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute
import pyarrow.parquet as pq

from chaosgym.classifier.shipped import has_classifier
from chaosgym.control import controllers
from chaosgym.control.controllers.table import JOBS
from chaosgym.control.maps import (
    FLEET,
    FLEET_SEED,
    JUDGED_CYCLES,
    SETTLING_CYCLES,
    Maps,
    fleet_maps,
    maps_of,
    model_keywords,
)
from chaosgym.control.policies.shipped import shipped_name
from chaosgym.control.rollout import Played, Policy, play
from chaosgym.control.scores import ONE, SAFE, ZERO
from chaosgym.envs.pool import Pool
from chaosgym.envs.task import Status
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import DatasetError, ParameterError, nearest_or
from chaosgym.files import write_atomically
from chaosgym.numbers import whole
from chaosgym.parquet import parquet_of

COLUMNS = ("contender", "knows", "seed", "machine", "job_return", "type_iii", "deviation", "damage", "largest_force")
"""Columns of a comparison's table, one row a job. ``LOAD`` is no part of files of earlier versions."""

LOAD = "equivalent_force"
"""Column of the constant peak force that wears the joint as much [N]."""

SUBJECTS = ("objective", "level", "split", "sealed")
"""Keywords that are part of what a comparison is of."""

CLASSIFIED = "back off, by the classifier"
"""Contender where a classifier of records is shipped."""

WITHOUT_MODELS = (ZERO, ONE, "own map, demands known", "back off", SAFE, "best felt", "kriging")
"""Contenders that need no model: those of a pool of machines."""

OF_OWN_MAPS = (ONE, "own map, demands known")
OF_A_FLEET = ("best constant trim", "best common schedule, demands known", "bandit", "belief")
"""Contenders that need maps of the machines played, and of simulated ones."""

WORN_LEVELS = 5
"""Clearances at which a machine that wears is mapped."""


class Contenders:
    """The controllers of a comparison by name; maps are made when the first one needs them."""

    def __init__(self, env: str, keywords: Mapping[str, Any], progress: bool) -> None:
        self.env, self.progress, self.keywords = env, progress, dict(keywords)
        self._fleet: Maps | None = None
        self._own: dict[tuple[int, ...], list[Maps]] = {}

    def makers(self, machines: Sequence[int] = ()) -> dict[str, Callable[[], Policy]]:
        """What makes each contender for these machines, in the order in which they are run."""
        known: dict[str, Callable[[], Policy]] = {
            ZERO: controllers.Follow,
            ONE: lambda: controllers.MapFollower(self.own(machines)),
            "own map, demands known": lambda: controllers.Schedule(self.own(machines)),
            "best constant trim": lambda: controllers.ConstantTrim(self.fleet),
            "skip bands": lambda: controllers.SkipBands(self._nominal()),
            "best common schedule, demands known": lambda: controllers.CommonSchedule(self.fleet),
            "back off": partial(controllers.BackOff, remembers=False),
            SAFE: controllers.BackOff,
            CLASSIFIED: partial(controllers.BackOff, classified=True),
            "best felt": controllers.BestFelt,
            "kriging": lambda: controllers.Kriging(price=None),
            "bandit": lambda: controllers.Bandit(self.fleet),
            "table": lambda: controllers.Table(self._tables()),
            "belief": lambda: controllers.Belief(self.fleet),
            "belief, exact model": lambda: controllers.Belief(self._exact_fleet()),
            "receding horizon": controllers.RecedingHorizon,
        }
        envs = native_envs(self.env, **self.keywords)
        if isinstance(envs.settings.variants, Pool):
            return {name: maker for name, maker in known.items() if name in WITHOUT_MODELS}
        if not has_classifier(envs.nominal.name):
            del known[CLASSIFIED]
        return known

    @property
    def _training(self) -> dict[str, Any]:
        """Keywords of the machines from which a contender may learn: of a split those of training."""
        given = {name: value for name, value in self.keywords.items() if name != "sealed"}
        return given | ({"split": "train"} if given.get("split") else {})

    @property
    def fleet(self) -> Maps:
        """Maps of simulated machines within the tolerances."""
        if self._fleet is None:
            self._fleet = fleet_maps(self.env, progress=self._bar("maps of models"), **self._training)
        return self._fleet

    def own(self, machines: Sequence[int]) -> list[Maps]:
        """Maps of machines that are played; where they wear, at ``WORN_LEVELS`` clearances."""
        key = tuple(machines)
        if key not in self._own:
            known = native_envs(self.env, **self.keywords)
            wear, nominal = known.task.wear, known.nominal
            field, levels = nominal.clearance_field, WORN_LEVELS if wear > 0.0 else 1

            def worn(level: int) -> dict[str, float]:
                factor = 1.0 + wear * level / max(1, levels - 1)
                return {field: getattr(nominal, field) * factor} if levels > 1 else {}

            self._own[key] = [
                maps_of(
                    self.env,
                    machines=machines,
                    progress=self._bar("own maps"),
                    **(self.keywords | worn(k)),
                )
                for k in range(levels)
            ]
        return self._own[key]

    def _exact_fleet(self) -> Maps:
        """As ``fleet``, of models as fine as the machine: what the belief is worth if the model is right."""
        seeds = [FLEET_SEED + k for k in range(FLEET)]
        return maps_of(self.env, seeds=seeds, progress=self._bar("maps of exact models"), **self._training)

    def _tables(self) -> Any:
        return controllers.learned_tables(self.env, progress=self._bar("tables"), **self._training)

    def _nominal(self) -> Maps:
        known = {name: value for name, value in self._training.items() if name != "split"}
        return maps_of(self.env, seeds=[0], **(model_keywords(self.env, **known) | {"tolerances": {}}))

    def _bar(self, name: str) -> str | None:
        return name if self.progress else None


def compare(
    env: str,
    out: Path,
    *,
    machines: int | None = None,
    only: Iterable[str] | None = None,
    policies: Mapping[str, Sequence[Policy]] | None = None,
    progress: bool = False,
    **keywords: Any,
) -> pa.Table:
    """Run all contenders, and keep a row a job in one Parquet file; jobs that it holds already are not run again.

    Parameters
    ----------
    env
        Id of the environment, or the file of a machine.
    out
        The file; a comparison that was interrupted goes on.
    machines
        How many of those kept for evaluation; all by default.
    only
        Names of the controllers to run; all by default.
    policies
        Trained policies by name, one for each training seed.
    keywords
        Of the environment.

    Raises
    ------
    ParameterError
        If a controller is unknown, or there are not as many machines.
    DatasetError
        If the file is no comparison of this environment.
    """
    contenders = Contenders(env, keywords, progress)
    known_names = list(contenders.makers())
    chosen = known_names if only is None else list(only)
    for name in chosen:
        if name not in known_names:
            listed = f"known: {'; '.join(known_names)}"
            raise ParameterError(f"there is no controller {name!r}; {nearest_or(listed, name, known_names)}")
    known = native_envs(env, **keywords)
    kind = known.nominal
    subject = subject_of(env if kind.definition == kind.name else f"{env} ({kind.definition})", **keywords)
    kept = known.settings.variants.count
    count = kept if machines is None else whole("machines", machines, 1, kept)
    table = read_comparison(out, subject) if out.exists() else None
    work: list[tuple[str, int, Policy | None]] = [(name, 0, None) for name in chosen]
    work += [(name, seed, policy) for name, seeds in (policies or {}).items() for seed, policy in enumerate(seeds)]
    for name, seed, policy in work:
        missing = sorted(set(range(count)) - _played(table, name, seed))
        if not missing:
            continue
        player = policy or contenders.makers(missing)[name]()
        played = play(player, env, missing, progress=name if progress else None, **keywords)
        rows = job_rows(name, player.knows, seed, played, subject)
        table = rows if table is None else joined(table, rows)
        write_comparison(table, out)
    assert table is not None
    return table


def most_cycles(env: str, *, machines: int | None = None, only: Iterable[str] | None = None, **keywords: Any) -> int:
    """Cycles that a comparison from its beginning runs, those of maps and tables from which controllers learn included.

    Examples
    --------
    >>> from chaosgym.control.comparison import most_cycles
    >>> task = "chaosgym/ImpactBeamTolerance-v1"
    >>> most_cycles(task, machines=8, only=["kriging"]) < 0.01 * most_cycles(task, machines=8)
    True
    """
    envs = native_envs(env, **keywords)
    task = envs.task
    names = list(Contenders(env, keywords, False).makers()) if only is None else list(only)
    count = envs.settings.variants.count if machines is None else machines
    job, swept = task.steps * task.cycles_per_step, len(task.grid) * (SETTLING_CYCLES + JUDGED_CYCLES)
    own = count * swept * (WORN_LEVELS if task.wear > 0.0 else 1) * any(name in OF_OWN_MAPS for name in names)
    fleets = FLEET * swept * (any(name in OF_A_FLEET for name in names) + ("belief, exact model" in names))
    return len(names) * count * job + own + fleets + JOBS * job * ("table" in names)


def _played(table: pa.Table | None, name: str, seed: int) -> set[int]:
    """Machines that a contender has played."""
    if table is None:
        return set()
    its = (pa.compute.field("contender") == name) & (pa.compute.field("seed") == seed)
    return set(table.filter(its)["machine"].to_pylist())


def job_rows(name: str, knows: str, seed: int, played: Played, env: str) -> pa.Table:
    """Rows of a comparison: one for each job of a contender."""
    count = len(played.machines)
    columns = {
        "contender": pa.array([name] * count),
        "knows": pa.array([knows] * count),
        "seed": pa.array([seed] * count, pa.int32()),
        "machine": pa.array(played.machines, pa.int32()),
        "job_return": played.returns,
        "type_iii": played.type_iii_share,
        "deviation": played.deviation,
        "damage": played.damage,
        "largest_force": played.largest_force,
        "failed": played.status != int(Status.JOB_DONE),
        "equivalent_force": played.equivalent_force,
    }
    return pa.table(columns).replace_schema_metadata({"env": env})


def joined(*tables: pa.Table) -> pa.Table:
    """Rows of several tables; a column that one of them lacks has nulls there."""
    return pa.concat_tables(tables, promote_options="default")


def write_comparison(table: pa.Table, path: Path) -> None:
    """Write the table of a comparison."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, lambda file: pq.write_table(table, file, compression="zstd"))


def read_comparison(path: Path, env: str | None = None) -> pa.Table:
    """Read the table of a comparison.

    Raises
    ------
    DatasetError
        If the file can't be read, or is of another environment.
    """
    try:
        table = parquet_of(path)
    except ValueError as error:
        raise DatasetError(f"{path} is no comparison: it {error}") from None
    missing = [name for name in COLUMNS if name not in table.column_names]
    of = (table.schema.metadata or {}).get(b"env", b"").decode()
    if missing or (env is not None and of != env):
        raise DatasetError(f"{path} is no comparison of {env or 'an environment'}; it is of {of or 'nothing known'}")
    return table


def shipped_comparison(env: str, **keywords: Any) -> pa.Table | None:
    """The comparison that comes with chaosgym for an environment with these keywords, if there is one."""
    level = keywords.get("level")
    if keywords not in ({}, {"level": level, "split": "test"}):
        return None
    path = Path(str(resources.files("chaosgym.control"))) / "results" / f"{shipped_name(env, level)}.parquet"
    return read_comparison(path, subject_of(env, **keywords)) if path.is_file() else None


def subject_of(env: str, **keywords: Any) -> str:
    """Subject of a comparison: the environment, and the keywords that differ from the id's own.

    Examples
    --------
    >>> from chaosgym.control.comparison import subject_of
    >>> subject_of("chaosgym/ImpactBeamTolerance-v1", level="fleet", split="test")
    'chaosgym/ImpactBeamTolerance-v1, level fleet, split test'
    """
    told = {name: keywords[name] for name in SUBJECTS if keywords.get(name) not in (None, False, "irregular")}
    return env + "".join(f", {name} {value}" for name, value in told.items())
