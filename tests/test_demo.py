"""The demo passes through every floor; here with a smaller sweep and fewer machines."""

from pathlib import Path

import pytest

from chaosgym import ImpactBeam, demo, response_type
from chaosgym.errors import DatasetError
from tests.small_demo import SMALL


@pytest.mark.parametrize(("kind", "point"), demo.POINTS.items())
def test_a_point_has_the_type_that_its_legend_names(kind, point):
    """The picture calls three points of the beam Type I, II and III; over their tolerances they are."""
    frequency, clearance = point
    assert response_type(ImpactBeam(excitation_frequency=frequency, clearance=clearance), workers=1).type == kind


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:CUDA initialization")
def test_demo_computes_every_number_and_draws_each_step(tmp_path, monkeypatch):
    """Three points of the printed natures, a typed sweep, a judged classifier, an agent beside two rules.

    Without training, ``tests/cli/test_answers.py`` holds what it prints to the schema.
    """
    for name, value in SMALL.items():
        monkeypatch.setattr(demo, name, value)
    said, drawn = [], []

    def say(line):
        said.append(line.removeprefix("    picture: "))
        drawn.append(len(list((tmp_path / "demo").glob("*.png"))))

    result = demo.run_demo(tmp_path / "demo", train=True, say=say)
    assert drawn == [0, 1, 1, 2, 2, 3, 3, 4], "every step draws its picture before the next one begins"
    assert said[1::2] == result["pictures"]
    assert [row["nature"] for row in result["points"].values()] == ["periodic", "periodic", "chaotic"]
    assert result["points"]["III"]["type_in_sweep"] == "III"
    assert result["sweep"]["points"] == 120
    assert 0.0 <= result["classifier"]["stages"]["parameters"]["accuracy"][0] <= 1.0
    assert all(row["return"] < 0.0 for row in result["agent"].values())
    assert (tmp_path / "demo" / "policy" / "policy.json").exists()
    assert all(Path(picture).stat().st_size > 20_000 for picture in result["pictures"])
    assert any("chaotic" in line for line in demo.demo_table(result))
    with pytest.raises(DatasetError, match="choose another folder"):
        demo.run_demo(tmp_path / "demo", say=said.append)
