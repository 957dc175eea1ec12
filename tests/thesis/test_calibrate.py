"""A calibration finds what can be found, goes on where it stopped, and says how well it knows."""

import json
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.errors import DatasetError, ParameterError
from chaosgym.machines import THESIS_IMPACT_BEAM
from chaosgym.machines.impact_beam.modes import static_tip_deflection
from chaosgym.machines.parameters import parameters_of
from chaosgym.machines.slider_crank.parameters import frequencies_at
from thesis.scorecard import calibrate as calibration
from thesis.scorecard.calibrate import Budget
from thesis.scorecard.determination import determine
from thesis.scorecard.findings import Finding
from thesis.scorecard.objective import calibration_statements, cost, objective
from thesis.scorecard.search_space import (
    SEARCH_SPACES,
    STATIC_TIP_DEFLECTION,
    Real,
    SearchSpace,
    Whole,
    Word,
    with_printed_deflection,
)
from thesis.scorecard.verdicts import judge
from thesis.statements import read_comparisons

BEAM = SEARCH_SPACES["impact-beam"]
CRANK = SEARCH_SPACES["slider-crank"]
COMPARED = {one.id: one for one in read_comparisons().compared}


@pytest.mark.parametrize("space", [BEAM, CRANK], ids=["beam", "crank"])
def test_first_candidate_is_the_present_machine(space):
    """The search begins at the constants in use, so it can't end worse."""
    machine = space.machine(space.starts[0])
    for name in parameters_of(machine):
        value, present = getattr(machine, name), getattr(space.base, name)
        assert value == present or value == pytest.approx(present, rel=1e-3), name


def test_searched_parameters_are_not_in_print():
    """Printed numbers stay, but for the number of modes, which the thesis gives without saying which."""
    for space in (BEAM, CRANK):
        described = parameters_of(space.base)
        for dimension in space.dimensions:
            if dimension.name not in ("inertia_ratio", "n_modes"):
                assert described[dimension.name].provenance in ("calibrated", "assumed"), dimension.name


def test_every_candidate_keeps_the_printed_numbers():
    """Static deflection 3.175 mm for a beam, first frequency 75.6 Hz for a crank, whatever else is searched."""
    rng = np.random.default_rng(3)
    for _ in range(3):
        beam = with_printed_deflection(
            replace(THESIS_IMPACT_BEAM, width=rng.uniform(12e-3, 26e-3), force_position=rng.uniform(0.12, 0.22))
        )
        assert static_tip_deflection(beam) == pytest.approx(STATIC_TIP_DEFLECTION, rel=1e-5)
        values = {**CRANK.starts[0], "inertia_ratio": rng.uniform(0.5, 3.0), "slider_mass": rng.uniform(0.1, 0.3)}
        assert frequencies_at(CRANK.machine(values), 0.0)[0] == pytest.approx(75.6, abs=1e-3)


def test_a_beam_without_such_a_pivot_is_refused():
    """A shaker stiffer than the printed static deflection allows leaves nothing to the pivot."""
    with pytest.raises(ParameterError, match="shaker_stiffness = 10000 N/m"):
        with_printed_deflection(replace(THESIS_IMPACT_BEAM, shaker_stiffness=1e4))


def test_cost_grows_with_the_error_and_stays_below_one():
    """0 when met, a half at the edge of a hit, more for a wrong nature than for a wrong force alone."""
    force = COMPARED["IBS-028"]
    met, edge, far = (cost(judge(force, [Finding(value)])) for value in (70.0, 80.5, 700.0))
    assert met == 0.0
    assert edge == pytest.approx(0.5)
    assert edge < far < 1.0
    wrong = cost(judge(force, [Finding(80.5, agrees=False, deviation=0.6)]))
    assert edge < wrong < 1.0
    assert objective([judge(force, [Finding(70.0)]), judge(force, [Finding(80.5)])]) == pytest.approx(0.25)


def test_a_calibration_sees_neither_held_out_nor_contradictory_statements():
    """What judges a calibration must not lead it."""
    for name in ("impact-beam", "slider-crank"):
        seen = [one for stage in calibration_statements(name) for one in stage]
        assert seen
        assert all(one.part == "calibration" and not one.contradictory for one in seen)


@pytest.mark.parametrize("text", ["", "0", "-3", "1.5", "xmin", "0min", "infmin", "nanmin", "1e9min"])
def test_a_budget_that_is_none_is_refused(text):
    """Trials are whole and positive, minutes positive and finite."""
    with pytest.raises(ParameterError, match="budget"):
        Budget.parse(text)


def test_budgets_are_trials_or_minutes():
    """A bare number counts trials."""
    assert Budget.parse("400") == Budget(trials=400)
    assert Budget.parse("2.5min") == Budget(minutes=2.5)


TOY = SearchSpace(
    THESIS_IMPACT_BEAM,
    (
        Real("width", 12e-3, 26e-3, "m"),
        Real("shaker_damping", 5.0, 120.0, "N s/m", log=True),
        Whole("n_modes", 4, 7),
        Word("damping_family", ("uniform", "stiffness")),
    ),
    lambda base, values: replace(base, **values),
    ({"width": 17.58e-3, "shaker_damping": 22.5, "n_modes": 5, "damping_family": "stiffness"},),
    20,
)


def bowl(machine, *, workers=None):
    """An objective that depends on the width alone, least at 20 mm, in two stages."""
    value = min(1.0, abs(machine.width - 20e-3) / 10e-3)
    yield 0.5 * value
    yield value


@pytest.fixture
def toy(monkeypatch):
    """The search with a known answer instead of simulations."""
    monkeypatch.setattr(calibration, "staged_objective", bowl)
    monkeypatch.setattr("thesis.scorecard.determination.staged_objective", bowl)

    def search(folder, trials, seed=0):
        study = calibration._open(folder, {"seed": seed}, TOY)
        return calibration._search(study, TOY, Budget(trials=trials), seed, 1, False)

    return search


def test_search_finds_the_least_objective(toy, tmp_path):
    """150 trials place the width within half a millimetre of the answer; most candidates are given up early."""
    finished = toy(tmp_path / "run", 150)
    complete = calibration._complete(finished)
    best = min(complete, key=lambda trial: trial.value)
    assert best.params["width"] == pytest.approx(20e-3, abs=0.5e-3)
    assert len(complete) < 0.5 * len(finished)


def test_a_stopped_search_goes_on_as_if_it_had_not_been_stopped(toy, tmp_path):
    """30 trials and 45 more try the same candidates as 75 at once; another seed tries others."""
    whole = toy(tmp_path / "whole", 75)
    toy(tmp_path / "parts", 30)
    parts = toy(tmp_path / "parts", 75)
    assert [trial.params for trial in whole] == [trial.params for trial in parts]
    assert [trial.params for trial in toy(tmp_path / "other", 75, seed=1)] != [trial.params for trial in whole]


def test_a_folder_of_something_else_is_left_alone(toy, tmp_path):
    """Another seed, or files that are no calibration."""
    toy(tmp_path / "run", 2)
    held = (tmp_path / "run" / "journal.log").read_bytes()
    with pytest.raises(DatasetError, match="differs in seed"):
        toy(tmp_path / "run", 4, seed=1)
    assert (tmp_path / "run" / "journal.log").read_bytes() == held
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("keep")
    with pytest.raises(DatasetError, match="no calibration"):
        toy(tmp_path / "mine", 2)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]


def test_determination_tells_known_from_unknown_parameters(toy, tmp_path):
    """The width decides the toy objective, the damper does not: narrow against wide, steep against flat."""
    finished = toy(tmp_path / "run", 150)
    complete = calibration._complete(finished)
    values = min(complete, key=lambda trial: trial.value).params
    found = {one.name: one for one in determine(TOY, values, complete)}
    assert found["width"].spread < 0.5 * found["shaker_damping"].spread
    assert max(found["width"].sensitivity.values()) > 0.05
    assert np.ptp(list(found["shaker_damping"].sensitivity.values())) == 0.0
    assert found["damping_family"].spread is None
    assert json.loads(json.dumps(found["n_modes"].as_dict()))["searched"] == [4, 7]
