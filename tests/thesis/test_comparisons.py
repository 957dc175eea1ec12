import numpy as np
import pytest

from chaosgym.errors import SimulationError
from tests.plain_modes import PLAIN_BEAM
from thesis.figures import FIGURES, draw_figures
from thesis.figures.beam import DAMPING
from thesis.figures.computations import Runs, Types
from thesis.figures.crank_maps import SLIDER_MAP
from thesis.figures.crank_resonances import resonance
from thesis.figures.figure import Finding
from thesis.figures.flips import flips
from thesis.figures.gallery import gallery, sensitivities
from thesis.figures.printed import comparison
from thesis.figures.produce import Drawn
from thesis.scorecard.observation import THOROUGH


def test_a_resonance_stands_above_its_background():
    """A peak of four times the force at 1134 rpm is order 4; a force that only rises has no local maximum."""
    speed = np.linspace(1080.0, 1190.0, 56)
    peak = 20.0 + 60.0 * np.exp(-(((speed - 1134.0) / 6.0) ** 2))
    rise = np.linspace(20.0, 40.0, len(speed))
    for force, ratio in ((peak, 4.0), (rise, 1.0)):
        data = {"crank_speed": speed, "peaks": force[:, None]}
        at, _, found = resonance(data, 4)
        assert found == pytest.approx(ratio, rel=0.01)
    assert abs(at - 1134.0) < 0.05 * 1134.0


def test_flips_name_the_steps_at_which_the_nature_changes():
    """Of three steps of 1 % damping the second flips the nature; an undetermined point hides no flip farther away."""
    data = {
        "damping_ratio": np.array([0.01, 0.02, 0.03, 0.04, 0.05]),
        "nature": np.array(["chaotic", "chaotic", "periodic", "undetermined", "chaotic"]),
    }
    assert flips(data, DAMPING, 1.0) == "2 to 3 % (chaotic to periodic)"
    assert flips({**data, "nature": np.full(5, "periodic")}, DAMPING, 1.0) == "nowhere"


def test_a_run_that_fails_is_shown_as_failed(monkeypatch):
    """One machine that can't be simulated leaves the others and has no force."""

    def fail(machine, *arguments, **options):
        raise SimulationError("diverged")

    monkeypatch.setattr("thesis.figures.computations.simulate", fail)
    data = Runs(machines=(PLAIN_BEAM,), fields=("clearance",), cycles=20, transient=0).run()
    assert data["nature"].tolist() == ["failed"]
    assert np.isnan(data["peaks"]).all()


def test_a_figure_that_fails_leaves_the_others(tmp_path, monkeypatch):
    """Its error is told, no picture is written, and the next figure is drawn."""

    def fail(self, workers=None):
        raise SimulationError("diverged")

    monkeypatch.setattr(Types, "run", fail)
    broken, drawn = draw_figures([FIGURES["3.9"], FIGURES["3.6"]], tmp_path, resolution=0.1)
    assert broken.error == "diverged"
    assert not broken.path.exists()
    assert drawn.path.exists()
    assert "Not computed: diverged" in gallery([broken, drawn], tmp_path)


def test_the_gallery_names_rows_of_the_scorecard_and_tells_the_rest(tmp_path):
    """A statement that the scorecard tells in full stands by its name and verdict, any other one in words."""
    valley = Finding("19 Hz: 15 N", "24 N", agrees=False, targets=("IBS-025",), sensitivity="speed", scored=True)
    range_ = Finding("30 Hz: 30 to 85 N", "60 to 78 N", agrees=False, targets=("IBS-029",), scored=True)
    found = (valley, range_, Finding("a crest", "none", agrees=None))
    page = gallery([Drawn(FIGURES["3.8"], tmp_path / "none.png", found, 0.0)], tmp_path)
    assert "- **differs**: IBS-025\n- not judged: IBS-029\n- a crest. Here none: not decided.\n" in page
    assert "24 N" not in page
    assert "| speed | 3.8 | 0 | 1 |" in page


def test_the_map_of_the_slider_is_calm_at_small_clearance():
    """At 5 % contact damping the slider rattles periodically at +-0.032 mm, chaotically at +-0.254 mm (4.5.4)."""
    part = SLIDER_MAP.parts(0.1)["map"]
    chosen = [one for one in part.machines if one.crank_speed in (100.0, 150.0, 200.0)]
    data = Runs(machines=tuple(chosen), fields=part.fields, cycles=part.cycles, transient=part.transient).run()
    nature = dict(zip(zip(data["crank_speed"], data["slider_clearance"], strict=True), data["nature"], strict=True))
    assert {nature[speed, 0.03175e-3] for speed in (100.0, 150.0, 200.0)} == {"periodic"}
    assert "chaotic" in {nature[speed, 0.254e-3] for speed in (100.0, 150.0, 200.0)}


@pytest.mark.parametrize(
    ("number", "part", "target"),
    [
        ("3.8", "a", "IBS-021"),
        ("3.13", "dampings", "IBS-045"),
        ("4.8", "ball", "SSC-028"),
        ("4.9", "map", "SSC-033"),
        ("4.13", "slider", "SSC-042"),
        ("4.14", "b", "SSC-055"),
    ],
)
def test_a_figure_draws_the_runs_that_its_statements_are_judged_by(number, part, target):
    """Every point of the scorecard's grid is drawn, and its run is as long."""
    drawn, judged = FIGURES[number].parts(1.0)[part], comparison(target)
    assert (drawn.transient, drawn.cycles) == THOROUGH[judged.machine][:2]
    for axis in (judged.along, judged.across):
        values = [] if axis is None else [getattr(machine, axis.field) for machine in drawn.machines]
        assert axis is None or all(np.isclose(values, wanted, rtol=1e-6).any() for wanted in axis.values)


@pytest.mark.slow
def test_every_printed_sensitivity_is_answered(tmp_path):
    """Clearance, speed, lengths, dampings, friction and flexibility: each is compared in some figure."""
    ids = ["3.8", "3.9", "3.11", "3.12", "3.13", "4.14", "4.16", "4.17", "4.18", "5.4"]
    drawn = draw_figures([FIGURES[name] for name in ids], tmp_path, resolution=0.1)
    assert not [one.error for one in drawn if one.error]
    assert set(sensitivities(drawn)) == {
        "speed",
        "clearance",
        "beam length",
        "rod length",
        "structural damping",
        "contact damping",
        "friction",
        "flexibility",
    }
