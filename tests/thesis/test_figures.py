import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from chaosgym.errors import ChaosgymError
from chaosgym.machines import ImpactBeam
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate
from tests.plain_modes import PLAIN_BEAM
from thesis.cache import default_folder
from thesis.cli import app
from thesis.figures import FIGURES, chosen, draw_figures
from thesis.figures.computations import ForcePointHistory, Runs
from thesis.figures.figure import steps
from thesis.figures.findings import compare_response
from thesis.figures.gallery import gallery
from thesis.figures.printed import comparison
from thesis.figures.produce import computed
from thesis.scorecard.evaluation import THESIS_MACHINES, evaluate
from thesis.scorecard.observation import THOROUGH

SIMULATED = [
    *(f"3.{number}" for number in (*range(6, 14), 17, 18)),
    *(f"4.{number}" for number in (*range(7, 19), 25)),
    *(f"5.{number}" for number in (*range(1, 5), *range(6, 15))),
]
"""Simulated figures of the thesis, and the simulated counterparts of 5.8 and 5.12."""


def test_every_simulated_figure_of_the_thesis_is_there():
    """3.6 to 3.13, 3.17, 3.18, 4.7 to 4.18, 4.25, 5.1 to 5.4 and 5.6 to 5.14, in order, and nothing else."""
    assert list(FIGURES) == SIMULATED


def test_an_unknown_figure_is_refused_with_the_list():
    """Figure 3.14 is a measurement; the message names what there is."""
    with pytest.raises(ChaosgymError, match=r"(?s)no figure 3\.14.*3\.8 .*Peak impact force"):
        chosen(["3.14"])


def test_a_periodic_figure_says_what_the_simulation_says(tmp_path):
    """The beam repeats every cycle at 19 Hz and +-0.127 mm; the figure's finding is the nature of that very run."""
    (one,) = draw_figures(chosen(["3.6"]), tmp_path, resolution=0.1, workers=1)
    assert one.path.read_bytes().startswith(b"\x89PNG")
    peaks = simulate(replace(ImpactBeam(), excitation_frequency=19.0), 100, transient=200).peak_force[:, 0]
    assert one.findings[0].here.startswith(f"{peaks.mean():.3g} N, periodic")
    assert one.findings[0].agrees is True


@pytest.mark.parametrize("number", ["5.1", "5.6"])
def test_a_figure_says_of_a_statement_what_the_scorecard_says(number, tmp_path):
    """Verdict, value and tolerance of a statement are the same on both pages, whatever else the figure draws."""
    (one,) = draw_figures(chosen([number]), tmp_path, resolution=0.1)
    names = [target for finding in one.findings for target in finding.targets]
    judged = evaluate(
        [comparison(name) for name in names],
        THESIS_MACHINES,
        efforts=THOROUGH,
        folder=default_folder(),
    )
    assert [finding.agrees for finding in one.findings] == [found.verdict == "hit" for found in judged]
    assert [finding.here.split(";")[0] for finding in one.findings] == [found.shown_value for found in judged]


@pytest.mark.parametrize(
    ("number", "label"),
    [
        ("5.1", "both agree, printed"),
        ("5.6", "bouncing, printed"),
        ("5.10", "spread of 30 deg, printed"),
        ("5.11", "spread of 6 mm, printed"),
        ("4.17", "periodic, printed"),
        ("3.13", "no chaos, printed"),
    ],
)
def test_what_the_text_prints_is_drawn_over_the_figure(number, label):
    """Cycles, durations, spreads and natures stand on the axes beside what is found here."""
    drawn = FIGURES[number].draw(made_up_parts(number))
    shown = [word for ax in drawn.axes for artist in ax.get_children() for word in words_of(artist)]
    assert label in shown


def words_of(artist):
    """What an artist of a figure says: its label and its text."""
    return [str(artist.get_label()), artist.get_text() if hasattr(artist, "get_text") else ""]


def made_up_parts(number):
    """A few points for each part of a figure, in place of a simulation."""
    values = np.array([0.01, 0.08])
    runs = {
        "damping_ratio": values,
        "crank_speed": np.array([100.0, 300.0]),
        "peaks": np.full((2, 20), 40.0),
        "nature": np.array(["periodic"] * 2),
        "period": np.ones(2, dtype=int),
    }
    force = np.tile([1.0, 0.0, -1.0, 0.0], 4)
    history = {"time": np.linspace(0.0, 0.2, len(force)), "force": force}
    impacts = {"location": np.array([0.0, 1e-3]), "force": np.ones(2)}
    cloud = {unit: {**impacts, "unit": np.array(unit)} for unit in ("m", "deg")}
    return {
        "5.1": {"runs": runs},
        "5.6": {"a": history, "b": history},
        "5.10": {"a": cloud["deg"], "b": cloud["deg"]},
        "5.11": {"cloud": cloud["m"]},
        "4.17": {"without": runs, "with": runs},
        "3.13": {"dampings": runs},
    }[number]


def test_pictures_are_replaced_only_on_request(tmp_path):
    """A picture that exists stops everything before any computing, unless it may be replaced; results are read back."""
    figures = chosen(["3.13"])
    (first,) = draw_figures(figures, tmp_path, resolution=0.1, workers=1)
    before = first.path.read_bytes()
    with pytest.raises(ChaosgymError, match="--overwrite"):
        draw_figures(figures, tmp_path, resolution=0.1)
    (again,) = draw_figures(figures, tmp_path, resolution=0.1, overwrite=True)
    assert again.path.read_bytes() == before
    assert again.findings == first.findings
    assert "3.13" in gallery([first], tmp_path)


def test_a_result_is_kept_under_all_that_it_depends_on(tmp_path, monkeypatch):
    """Another machine, count of cycles or source is another file; the same description is read, not computed."""
    runs = Runs(machines=(PLAIN_BEAM,), fields=("clearance",), cycles=20, transient=0)
    others = [
        Runs(
            machines=(with_settings(PLAIN_BEAM, {"width": 0.0176}),),
            fields=("clearance",),
            cycles=20,
            transient=0,
        ),
        Runs(machines=(PLAIN_BEAM,), fields=("clearance",), cycles=21, transient=0),
    ]
    first = computed(runs, tmp_path)
    assert np.array_equal(first["peaks"][0], simulate(PLAIN_BEAM, 20).peak_force[:, 0])
    (kept,) = tmp_path.iterdir()
    monkeypatch.setattr(Runs, "run", lambda *_: pytest.fail("computed again"))
    assert all(np.array_equal(first[name], again) for name, again in computed(runs, tmp_path).items())
    monkeypatch.undo()
    for damaged in (b"", kept.read_bytes()[:-40], b"garbage"):
        kept.write_bytes(damaged)
        assert np.array_equal(computed(runs, tmp_path)["peaks"], first["peaks"]), "a damaged file is computed again"
    for other in others:
        computed(other, tmp_path)
    assert len(list(tmp_path.iterdir())) == 3
    monkeypatch.setattr("thesis.cache.SOURCES", "edited")
    computed(runs, tmp_path)
    assert len(list(tmp_path.iterdir())) == 4


def test_the_force_point_follows_the_recorded_forces():
    """Driven by shaker and recorded contact force, the modes give the kernel's tip motion within 1 % of the gap."""
    data = ForcePointHistory(machine=PLAIN_BEAM, cycles=3, transient=40).run()
    assert np.max(np.abs(data["tip_check"] - data["tip_displacement"])) < 0.01 * PLAIN_BEAM.clearance
    assert np.max(np.abs(data["displacement"])) < 1.5 * PLAIN_BEAM.clearance


@pytest.mark.slow
def test_crests_collapse_over_the_frequency_ratio(tmp_path):
    """Crests of the force shift with the beam's length as its first pinned-pinned frequency does (figure 3.11)."""
    (one,) = draw_figures(chosen(["3.11"]), tmp_path, resolution=0.4)
    assert all(finding.agrees for finding in one.findings), one.findings


def test_steps_hold_what_must_be_among_them():
    """A coarse axis still has the printed points."""
    assert steps(1.0, 30.0, 10.0, 19.0) == (1.0, pytest.approx(10.6666667), 19.0, pytest.approx(20.3333333), 30.0)


@pytest.mark.parametrize(("force", "agrees"), [(72.0, True), (79.0, True), (82.0, False)])
def test_a_force_agrees_within_15_percent(force, agrees):
    """70 N are printed at 29 Hz: 80.5 N is the last force that agrees."""
    finding = compare_response("29 Hz", "IBS-028", (np.full(5, force), "periodic", 1), "periodic")
    assert finding.agrees is agrees
    assert compare_response("29 Hz", "IBS-028", (np.full(5, force), "chaotic", 0), "periodic").agrees is False


def test_the_command_lists_draws_and_refuses(tmp_path):
    """``figures`` names every figure, draws the one asked for, and refuses without a folder."""
    run = CliRunner().invoke
    assert json.loads(run(app, ["figures", "--list", "--json"]).stdout)["figures"].keys() == FIGURES.keys()
    result = json.loads(run(app, ["figures", "3.6", "--out", str(tmp_path), "--resolution", "0.1", "--json"]).stdout)
    assert [one["id"] for one in result["figures"]] == ["3.6"]
    assert result["totals"] == {"agree": 1, "differ": 0, "contradictory": 0, "undecided": 0}
    assert run(app, ["figures", "3.6"]).exit_code == 2
    assert isinstance(
        run(app, ["figures", "3.6", "--out", str(tmp_path), "--resolution", "0"]).exception, ChaosgymError
    )
