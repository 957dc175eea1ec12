"""The demo passes through every floor; here with a smaller sweep and a shorter training."""

import pytest

from chaosgym import ImpactBeam, demo, response_type
from chaosgym.errors import DatasetError
from tests.small_demo import SMALL


@pytest.mark.parametrize(("kind", "point"), demo.POINTS.items())
def test_a_point_has_the_type_that_its_legend_names(kind, point):
    """The figure calls three points of the beam Type I, II and III; over their tolerances they are."""
    frequency, clearance = point
    assert response_type(ImpactBeam(excitation_frequency=frequency, clearance=clearance), workers=1).type == kind


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:CUDA initialization")
def test_demo_computes_every_number_and_draws_the_figure(tmp_path, monkeypatch):
    """Three points of the printed natures, a typed sweep, a judged classifier, an agent beside two rules."""
    for name, value in SMALL.items():
        monkeypatch.setattr(demo, name, value)
    said, drawn = [], []

    def say(line):
        said.append(line)
        drawn.append((tmp_path / "demo" / "overview.png").exists())

    result = demo.run_demo(tmp_path / "demo", say=say)
    assert drawn == [False, True, True, True, True], "the three points are drawn before the sweep"
    assert [row["nature"] for row in result["points"].values()] == ["periodic", "periodic", "chaotic"]
    assert result["points"]["III"]["type_in_sweep"] == "III"
    assert result["sweep"]["points"] == 120
    assert 0.0 <= result["classifier"]["stages"]["parameters"]["accuracy"][0] <= 1.0
    assert result["agent"]["agent"]["return"] < 0.0
    assert (tmp_path / "demo" / "overview.png").stat().st_size > 20_000
    assert len(said) == 5
    assert any("chaotic" in line for line in demo.demo_table(result))
    with pytest.raises(DatasetError, match="choose another folder"):
        demo.run_demo(tmp_path / "demo", say=said.append)
