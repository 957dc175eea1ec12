"""The calibration: values of the parameters that are not in print which bring a machine closest to the thesis.

A tree-structured Parzen estimator (Optuna) proposes candidates; those that the single runs rule out are given up before
the curves. The journal in the folder is written after every trial, and every trial draws from its own seed, so that a
stopped search goes on as if it had not been stopped. The best candidates of the quick runs are judged by thorough ones.
"""

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.errors import ChaosgymError, DatasetError, ParameterError
from chaosgym.files import is_empty, write_atomically
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.version import __version__
from thesis.cache import default_folder
from thesis.scorecard.determination import Determination, determine
from thesis.scorecard.objective import calibration_statements, objective, staged_objective
from thesis.scorecard.observation import THOROUGH
from thesis.scorecard.scorecard import Scorecard, evaluate, scorecard
from thesis.scorecard.search_space import SEARCH_SPACES, Dimension, Real, SearchSpace, Whole

PLAN_FILE, JOURNAL_FILE, RESULT_FILE = "plan.json", "journal.log", "result.json"

PROMISING, EARLIEST = 0.15, 10
"""A candidate is given up unless its first stage is among this share of the earlier ones, once there are so many."""

FINALISTS = 6
"""Candidates of the quick search that are judged by thorough runs."""


@dataclass(frozen=True)
class Budget:
    """How long a search goes on: trials in all, or minutes of this call."""

    trials: int | None = None
    minutes: float | None = None

    @classmethod
    def parse(cls, text: str) -> "Budget":
        """Read ``20min`` or ``400`` (trials).

        Raises
        ------
        ParameterError
            If it is neither.
        """
        try:
            if text.endswith("min"):
                minutes = float(text.removesuffix("min"))
                if 0.0 < minutes <= 1e5:
                    return cls(minutes=minutes)
            elif 1 <= int(text) <= 10**6:
                return cls(trials=int(text))
        except ValueError:
            pass
        raise ParameterError(f"budget = {text!r} is out of range; allowed: 1 to 1000000 trials, or minutes as in 20min")


@dataclass(frozen=True)
class Calibration:
    """What a search found.

    Attributes
    ----------
    machine : Machine
        The best candidate by thorough runs, or the present constants if none is better.
    values
        Its values of the searched parameters.
    objective, present_objective
        Its objective and that of the present constants, by thorough runs.
    trials
        Candidates tried, the earlier calls on the folder included.
    card, present_card
        Every statement judged on it and on the present constants.
    determination
        How well each parameter is determined.
    """

    machine: Machine
    values: Mapping[str, Any]
    objective: float
    present_objective: float
    trials: int
    card: Scorecard
    present_card: Scorecard
    determination: tuple[Determination, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        name = self.machine.name
        rates = {
            which: {part: list(card.hit_rate(name, part)) for part in ("calibration", "held-out")}
            for which, card in (("best", self.card), ("present", self.present_card))
        }
        return {
            "version": __version__,
            "machine": name,
            "trials": self.trials,
            "objective": self.objective,
            "present_objective": self.present_objective,
            "searched": dict(self.values),
            "parameters": {field: getattr(self.machine, field) for field in parameters_of(self.machine)},
            "hits_of": rates,
            "determination": [one.as_dict() for one in self.determination],
            "residuals": [
                {**one.as_dict(), "part": one.comparison.part, "error_in_tolerances": _finite(one.error)}
                for one in self.card.judged
            ],
        }


def calibrate(
    name: str,
    budget: Budget,
    folder: Path,
    *,
    seed: int = 0,
    workers: int | None = None,
    cache: Path | None = None,
    progress: bool = False,
) -> Calibration:
    """Search the parameters of a machine that are not in print.

    Parameters
    ----------
    name
        Machine.
    budget
        Trials in all, or minutes of this call.
    folder
        New, empty, or holding a search of the same machine, seed and version, which goes on.
    seed
        Of the search.
    workers
        Number of threads; all processors by default.
    cache
        Where thorough runs are kept; the user's cache by default.
    progress
        Show progress bars on standard error.

    Raises
    ------
    DatasetError
        If the folder holds anything else. Nothing in it is touched.
    ChaosgymError
        If the optimiser is not installed.
    """
    space = SEARCH_SPACES[name]
    study = _open(folder, {"machine": name, "seed": seed, "version": __version__, "space": _described(space)}, space)
    finished = _search(study, space, budget, seed, workers, progress)
    cache = cache or default_folder()
    values, best, present = _final(space, finished, workers, cache, progress)
    machine = space.machine(values)
    result = Calibration(
        machine=machine,
        values=values,
        objective=best,
        present_objective=present,
        trials=len(finished),
        card=scorecard([name], bases={name: machine}, folder=cache, workers=workers, progress=progress),
        present_card=scorecard([name], bases={name: space.base}, folder=cache, workers=workers, progress=progress),
        determination=determine(space, values, _complete(finished), workers=workers, progress=progress),
    )
    text = json.dumps(result.as_dict(), indent=2, allow_nan=False) + "\n"
    write_atomically(folder / RESULT_FILE, lambda temporary: temporary.write_text(text))
    return result


def _optuna() -> Any:
    try:
        import optuna
    except ImportError as error:
        raise ChaosgymError("calibration needs the extra [calibrate]: pip install 'chaosgym[calibrate]'") from error
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    return optuna


def _open(folder: Path, plan: dict[str, Any], space: SearchSpace) -> Any:
    """The search in a folder, begun or gone on with."""
    optuna = _optuna()
    plan_file = folder / PLAN_FILE
    if plan_file.is_file():
        try:
            held = dict(json.loads(plan_file.read_text()))
        except (OSError, RecursionError, TypeError, ValueError) as error:
            raise DatasetError(f"{plan_file} is damaged: {error}; choose another folder") from error
        differing = sorted(key for key in plan.keys() | held.keys() if plan.get(key) != held.get(key))
        if differing:
            raise DatasetError(f"{folder} holds another calibration (it differs in {', '.join(differing)})")
    elif folder.exists() and (not folder.is_dir() or not is_empty(folder)):
        raise DatasetError(f"{folder} exists and is no calibration; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    begun = plan_file.is_file()
    if not begun:
        write_atomically(plan_file, lambda temporary: temporary.write_text(json.dumps(plan, indent=2) + "\n"))
    storage = optuna.storages.JournalStorage(optuna.storages.journal.JournalFileBackend(str(folder / JOURNAL_FILE)))
    study = optuna.create_study(storage=storage, study_name="calibration", load_if_exists=True)
    running = [trial for trial in study.trials if trial.state == optuna.trial.TrialState.RUNNING]
    for trial in running:
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
        study.enqueue_trial(trial.params)
    for start in space.starts[len(study.trials) :]:
        study.enqueue_trial(dict(start))
    return study


def _search(
    study: Any, space: SearchSpace, budget: Budget, seed: int, workers: int | None, progress: bool
) -> list[Any]:
    """Try candidates until the budget is spent; returns all finished trials."""
    optuna = _optuna()
    states = optuna.trial.TrialState
    finished = study.get_trials(deepcopy=False, states=(states.COMPLETE, states.PRUNED))
    began = time.monotonic()
    with tqdm(total=_total(budget), desc="calibrate", disable=not progress, unit=_unit(budget)) as bar:
        bar.update(len(finished) if budget.trials else 0)
        while _goes_on(budget, len(finished), began):
            study.sampler = optuna.samplers.TPESampler(
                seed=int(np.random.SeedSequence([seed, len(finished)]).generate_state(1)[0]),
                multivariate=True,
                n_startup_trials=space.random_trials,
            )
            trial = study.ask()
            threshold = _threshold(finished)
            try:
                value, complete = _try(trial, space, threshold, workers)
            except ParameterError:
                value, complete = 1.0, False
            if complete:
                study.tell(trial, value)
            else:
                study.tell(trial, state=states.PRUNED)
            finished = study.get_trials(deepcopy=False, states=(states.COMPLETE, states.PRUNED))
            bar.update(1 if budget.trials else round((time.monotonic() - began) / 60.0 - bar.n, 2))
            bar.set_postfix(trials=len(finished), best=min((t.value for t in _complete(finished)), default=1.0))
    return list(finished)


def _try(trial: Any, space: SearchSpace, threshold: float, workers: int | None) -> tuple[float, bool]:
    machine = space.machine({one.name: _suggest(trial, one) for one in space.dimensions})
    stages = staged_objective(machine, workers=workers)
    first = next(stages)
    trial.report(first, 0)
    if first > threshold:
        return first, False
    return _last(stages), True


def _last(values: Iterator[float]) -> float:
    return list(values)[-1]


def _suggest(trial: Any, dimension: Dimension) -> Any:
    if isinstance(dimension, Real):
        return trial.suggest_float(dimension.name, dimension.low, dimension.high, log=dimension.log)
    if isinstance(dimension, Whole):
        return trial.suggest_int(dimension.name, dimension.low, dimension.high)
    return trial.suggest_categorical(dimension.name, dimension.choices)


def _threshold(finished: list[Any]) -> float:
    """What the first stage of a new candidate must not exceed."""
    firsts = [trial.intermediate_values[0] for trial in finished if 0 in trial.intermediate_values]
    return float(np.quantile(firsts, PROMISING)) if len(firsts) >= EARLIEST else np.inf


def _complete(finished: list[Any]) -> list[Any]:
    return [trial for trial in finished if trial.state.name == "COMPLETE"]


def _goes_on(budget: Budget, trials: int, began: float) -> bool:
    if budget.trials is not None:
        return trials < budget.trials
    return time.monotonic() - began < 60.0 * (budget.minutes or 0.0)


def _total(budget: Budget) -> float:
    return float(budget.trials or budget.minutes or 0.0)


def _unit(budget: Budget) -> str:
    return "trial" if budget.trials else "min"


def _final(
    space: SearchSpace, finished: list[Any], workers: int | None, cache: Path, progress: bool
) -> tuple[Mapping[str, Any], float, float]:
    """Values of the best candidate by thorough runs, its objective, and that of the present constants."""
    statements = [one for stage in calibration_statements(space.base.name) for one in stage]

    def thorough(machine: Machine) -> float:
        return objective(evaluate(statements, {machine.name: machine}, efforts=THOROUGH, folder=cache, workers=workers))

    present = thorough(space.base)
    best: tuple[float, Mapping[str, Any]] = (present, space.starts[0])
    finalists = sorted(_complete(finished), key=_value)[:FINALISTS]
    for trial in tqdm(finalists, desc="finalists", disable=not progress, unit="candidate"):
        reached = thorough(space.machine(trial.params))
        if reached < best[0]:
            best = (reached, trial.params)
    return best[1], best[0], present


def _value(trial: Any) -> float:
    return float(trial.value)


def _described(space: SearchSpace) -> list[dict[str, Any]]:
    return [
        {"name": one.name, "range": [one.low, one.high] if isinstance(one, Real | Whole) else list(one.choices)}
        for one in space.dimensions
    ]


def _finite(error: float) -> float | None:
    return error if np.isfinite(error) else None
