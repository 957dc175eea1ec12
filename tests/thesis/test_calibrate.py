"""A calibration finds what can be found, goes on where it stopped, and says how well it knows."""

from dataclasses import replace

import numpy as np
import pytest

from chaosgym.errors import DatasetError, ParameterError
from chaosgym.machines import ImpactBeam
from chaosgym.machines.impact_beam.modes import static_tip_deflection
from chaosgym.machines.parameters import parameters_of
from chaosgym.machines.slider_crank.machine import frequencies_at
from tests.plain_modes import PLAIN_BEAM
from thesis.scorecard import search as calibration
from thesis.scorecard.calibrate import calibrate
from thesis.scorecard.findings import Finding
from thesis.scorecard.objective import WITHOUT_A_SLOPE, Objective, Stages, cost, objective, searched_statements
from thesis.scorecard.quantities import clearance_unit
from thesis.scorecard.search import Budget
from thesis.scorecard.search_space import (
    SEARCH_SPACES,
    STATIC_TIP_DEFLECTION,
    Basin,
    Real,
    SearchSpace,
    with_printed_deflection,
)
from thesis.scorecard.verdicts import judge
from thesis.statements import read_comparisons

BEAM = SEARCH_SPACES["impact-beam"]
CRANK = SEARCH_SPACES["slider-crank"]
COMPARED = {one.id: one for one in read_comparisons().compared}


def test_a_start_of_the_beam_is_the_present_machine():
    """The search begins at the constants in use too, so it can't end worse."""
    basin = next(one for one in BEAM.basins if one.name == "soft pivot, uniform damping")
    machine = BEAM.machine(basin, basin.shares())
    for name in parameters_of(machine):
        value, present = getattr(machine, name), getattr(BEAM.base, name)
        assert value == present or value == pytest.approx(present, rel=1e-3), name


def test_the_beam_that_is_fitted_is_the_one_that_users_get():
    """One beam: its number of modes is that of the rung "standard"; no basin is walled off from a soft pivot."""
    assert BEAM.base == ImpactBeam()
    for basin in BEAM.basins:
        lows = {one.name: one.low for one in basin.dimensions}
        assert lows["pivot_translational_stiffness"] <= 1e3
        assert lows["shaker_stiffness"] <= 1.0
        assert lows["shaker_damping"] <= 0.3
        assert {"shaker_mass", "force_position", "width"} <= set(lows)
    assert {basin.fixed["damping_family"] for basin in BEAM.basins} == {"beam", "uniform", "stiffness"}


def test_searched_parameters_are_not_in_print():
    """Printed numbers stay; what is no field of the machine stands for several that are not in print."""
    for space in (BEAM, CRANK):
        described = parameters_of(space.base)
        for dimension in [one for basin in space.basins for one in basin.dimensions]:
            if dimension.name in described:
                assert described[dimension.name].provenance in ("calibrated", "assumed"), dimension.name


def test_every_candidate_keeps_the_printed_numbers():
    """3.175 mm for a beam, 75.6 Hz and a dimensionless clearance of 0.016 for a crank, whatever else is searched."""
    rng = np.random.default_rng(3)
    for _ in range(3):
        beam = with_printed_deflection(
            replace(PLAIN_BEAM, width=rng.uniform(12e-3, 26e-3), force_position=rng.uniform(0.12, 0.22))
        )
        assert static_tip_deflection(beam) == pytest.approx(STATIC_TIP_DEFLECTION, rel=1e-5)
        basin = CRANK.basins[0]
        crank = CRANK.machine(basin, np.clip(basin.shares() + rng.uniform(-0.1, 0.1, len(basin.dimensions)), 0.0, 1.0))
        assert frequencies_at(crank, 0.0)[0] == pytest.approx(75.6, abs=1e-3)
        assert 0.254e-3 / clearance_unit(crank) == pytest.approx(0.016, rel=1e-3)


def test_a_beam_without_such_a_pivot_is_refused():
    """A shaker stiffer than the printed static deflection allows leaves nothing to the pivot."""
    with pytest.raises(ParameterError, match="shaker_stiffness = 10000 N/m"):
        with_printed_deflection(replace(PLAIN_BEAM, shaker_stiffness=1e4))


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


def test_a_search_follows_all_that_has_a_slope_and_nothing_contradictory():
    """Every statement is fitted on but those that one trajectory decides; contradictory ones lead nowhere."""
    for name in ("impact-beam", "slider-crank"):
        wanted = {
            one.id
            for one in COMPARED.values()
            if one.machine == name and not one.contradictory and one.quantity not in WITHOUT_A_SLOPE
        }
        assert set(searched_statements(name).ids) == wanted
    ball, slider = (set(searched_statements("slider-crank", joint).ids) for joint in ("ball", "slider"))
    assert ball | slider == wanted
    assert not ball & slider


def test_a_thinned_map_still_holds_its_boundary():
    """Quick runs look for a printed boundary on both sides of it."""
    for one in searched_statements("impact-beam").maps:
        if one.quantity == "map_clearance":
            assert one.across.low / one.across.unit < one.printed < one.across.high / one.across.unit
        if one.quantity == "map_speed":
            assert one.along.low < one.printed < one.along.high


@pytest.mark.parametrize("text", ["", "0", "-3", "1.5", "xmin", "0min", "infmin", "nanmin", "1e9min"])
def test_a_budget_that_is_none_is_refused(text):
    """Candidates are whole and positive, minutes positive and finite."""
    with pytest.raises(ParameterError, match="budget"):
        Budget.parse(text)


def test_budgets_are_candidates_or_minutes():
    """A bare number counts candidates."""
    assert Budget.parse("400") == Budget(candidates=400)
    assert Budget.parse("2.5min") == Budget(minutes=2.5)


NUMBERS = (Real("width", 12e-3, 26e-3, "m"), Real("shaker_damping", 5.0, 120.0, "N s/m", log=True))
TOY = SearchSpace(
    PLAIN_BEAM,
    (
        Basin("stiffness", {"damping_family": "stiffness"}, NUMBERS, {"width": 17.58e-3, "shaker_damping": 22.5}),
        Basin("uniform", {"damping_family": "uniform"}, NUMBERS, {"width": 13e-3, "shaker_damping": 100.0}),
        Basin("beam", {"damping_family": "beam"}, NUMBERS, {"width": 25e-3, "shaker_damping": 10.0}),
    ),
    lambda base, values: replace(base, **values),
)
STAGES = Stages((), (COMPARED["IBS-013"],), (COMPARED["IBS-020"],), ())


def bowl(aim, machine, unprinted, *, workers=None):
    """Costs that depend on the width alone, least at 20 mm, in two stages; one of the families is worse."""
    value = min(1.0, abs(machine.width - 20e-3) / 10e-3 + 0.3 * (machine.damping_family == "uniform"))
    yield {"IBS-013": value}
    yield {"IBS-020": value}


@pytest.fixture
def toy(monkeypatch):
    """The search with a known answer instead of simulations."""
    monkeypatch.setattr(Objective, "staged_costs", bowl)

    def search(folder, candidates, seed=0, draws=0):
        found = calibration.open_journal(folder, {"seed": seed, "statements": list(STAGES.ids), "draws": draws})
        journal = folder / calibration.JOURNAL_FILE
        calibration.search(
            found, TOY, Objective(STAGES), Budget(candidates=candidates), seed, journal, 1, False, draws=draws
        )
        return found

    return search


def test_search_finds_the_least_objective(toy, tmp_path):
    """150 candidates place the width within half a millimetre of the answer; the worse basin is left alone, and many
    candidates are given up."""
    found = toy(tmp_path / "run", 150)
    best = min(found, key=lambda one: one.value)
    assert TOY.basins[best.basin].values(best.shares)["width"] == pytest.approx(20e-3, abs=0.5e-3)
    assert sum(one.basin == 1 for one in found) < 0.25 * len(found)
    assert sum(len(one.costs) == 1 for one in found) > 0.2 * len(found)
    assert len(calibration.complete_costs(tmp_path / "run")) == sum(len(one.costs) == 2 for one in found)


def test_a_search_is_a_funnel(toy, tmp_path):
    """Of 100 draws over the ranges of each of three structures few go on to all statements; the evolution begins at the
    best draw, which is nearer to the answer than the structure's own start, and stopping changes nothing."""
    whole = toy(tmp_path / "whole", 320, draws=100)
    drawn = [one for one in whole if one.generation == calibration.DRAWN]
    assert len(drawn) == 303
    assert sum(len(one.costs) == 2 for one in drawn) < 0.15 * len(drawn)
    for k, basin in enumerate(TOY.basins):
        best = min((one for one in drawn if one.basin == k), key=lambda one: one.value)
        first = next((one for one in whole if one.basin == k and one.generation == 0), None)
        assert first is None or first.shares == best.shares
        assert abs(basin.values(best.shares)["width"] - 20e-3) < min(1e-3, abs(basin.start["width"] - 20e-3))
    toy(tmp_path / "parts", 150, draws=100)
    assert toy(tmp_path / "parts", 320, draws=100) == whole


def test_what_neighbours_hit_costs_nothing(monkeypatch):
    """The frequency at 284.0 mm follows Young's modulus, which a neighbour has up to 1 % off: half of one per cent of
    tolerance is hit by some neighbours alone, two per cent by all, none by none; the machine itself does not count."""
    frequency, costs = COMPARED["IBS-034"], {}
    for tolerance in (1e-6, 2e-3, 2e-2):
        asked = replace(frequency, tolerance=frequency.tolerance._replace(relative=tolerance))
        aim = Objective(Stages((), (asked,), (), ()), neighbours=6)
        (found,) = aim.staged_costs(PLAIN_BEAM, {}, workers=1)
        costs[tolerance] = found["IBS-034"]
    assert costs[2e-2] == 0.0 < costs[2e-3] < 0.8 < costs[1e-6]


def test_statements_of_one_figure_share_its_weight():
    """Three forces of figure 3.8a weigh as much as one nature of figure 3.6; each statement counts alone without
    neighbours. What was not run counts as missed."""
    stages = Stages((), tuple(COMPARED[name] for name in ("IBS-013", "IBS-024", "IBS-025", "IBS-026")), (), ())
    assert Objective(stages, 2).value(
        {"IBS-013": 0.0, "IBS-024": 1.0, "IBS-025": 1.0, "IBS-026": 1.0}
    ) == pytest.approx(0.5)
    assert Objective(stages, 2).value({"IBS-013": 0.0}) == pytest.approx(0.5)
    assert Objective(stages).value({"IBS-013": 0.0}) == 0.75


def test_a_screen_costs_few_runs():
    """The statements that screen are single runs, and those of the valley that hardly a beam shows."""
    stages = searched_statements("impact-beam")
    assert [one.id for one in stages.screen] == ["IBS-024", "IBS-025", "IBS-026"]
    assert all(one.along is None for one in stages.screen)
    assert searched_statements("slider-crank").screen == ()


def test_a_stopped_search_goes_on_as_if_it_had_not_been_stopped(toy, tmp_path):
    """30 candidates, a line cut off, and 46 more are the same as 75 at once; another seed tries others."""
    whole = toy(tmp_path / "whole", 75)
    toy(tmp_path / "parts", 30)
    journal = tmp_path / "parts" / "journal.jsonl"
    journal.write_text(journal.read_text()[:-20])
    assert toy(tmp_path / "parts", 75) == whole
    assert [one.shares for one in toy(tmp_path / "other", 75, seed=1)] != [one.shares for one in whole]


def test_a_folder_of_something_else_is_left_alone(toy, tmp_path):
    """Another seed, or files that are no calibration."""
    toy(tmp_path / "run", 2)
    held = (tmp_path / "run" / "journal.jsonl").read_bytes()
    with pytest.raises(DatasetError, match="differs in seed"):
        toy(tmp_path / "run", 4, seed=1)
    assert (tmp_path / "run" / "journal.jsonl").read_bytes() == held
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("keep")
    with pytest.raises(DatasetError, match="no calibration"):
        toy(tmp_path / "mine", 2)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]


def test_a_search_that_must_not_know_some_statements_begins_in_the_middle():
    """Every structure once, and no number of an earlier fit."""
    space = BEAM.from_the_middle()
    assert len(space.basins) == 3 < len(BEAM.basins)
    assert all(basin.shares() == pytest.approx([0.5] * len(basin.dimensions)) for basin in space.basins)


def test_structures_are_searched_by_the_beginning_of_their_names():
    """The others are left out, and a name that no structure has is refused."""
    assert [basin.fixed["gravity"] for basin in CRANK.only("under gravity").basins] == [9.81]
    assert len(CRANK.only("weightless").basins) == 2
    with pytest.raises(ParameterError, match=r"known: .*under gravity"):
        CRANK.only("heavy")


def test_a_figure_that_no_statement_is_about_is_refused(tmp_path):
    """A wrong name would leave nothing out and call it left out."""
    with pytest.raises(ParameterError, match=r"about figure 4\.14; known: .*4\.14a"):
        calibrate("slider-crank", Budget(candidates=1), tmp_path / "search", left_out=frozenset({"4.14"}))
    assert not (tmp_path / "search").exists()
