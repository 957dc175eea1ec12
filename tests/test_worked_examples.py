"""The worked examples of the documentation: their briefs ask what the page says, their reports what it shows."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.documentation.worked import run, shown
from chaosgym.design.brief import read_brief
from chaosgym.design.methodology import assess

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "worked-examples.md").read_text(encoding="utf-8")
NAMES = sorted(path.stem for path in (DOCS / "examples").glob("*.toml"))


def test_every_example_is_on_the_page():
    """Brief, machine, output and picture of each; the machines are those of the findings, a compressor and a pipe."""
    assert NAMES == ["compressor", "pipe"]
    for name in NAMES:
        brief = read_brief(DOCS / "examples" / f"{name}.toml")
        assert f"(examples/{name}.toml)" in PAGE
        assert f"(machines/{Path(brief.machine.name).name})" in PAGE
        assert (DOCS / "examples" / f"{name}.png").stat().st_size > 10_000
        assert f"{brief.series_size} machines within the tolerances, each run from rest" in shown(name, PAGE)
        assert f"report: {name}.html" in shown(name, PAGE)


def test_the_curvatures_of_the_pipe_are_those_of_a_clamped_beam():
    """2 b^2 / (l^2 sqrt(m l)) at the clamp, with the roots of cos b cosh b = -1, 1.2 m and 0.888 kg/m."""
    roots = [brentq(lambda b: math.cos(b) + 1.0 / math.cosh(b), low, low + 3.0) for low in (0.5, 3.2, 6.4, 9.5)]
    expected = 2.0 * np.square(roots) / (1.2**2 * math.sqrt(0.888 * 1.2))
    bending = read_brief(DOCS / "examples" / "pipe.toml").bending
    assert bending is not None
    assert list(bending.section.curvatures) == pytest.approx(expected.tolist(), rel=3e-3)


def test_the_pipe_is_of_the_type_that_the_page_says():
    """The nominal machine and a few of its tolerances: chaotic, and longer-lived in bending than the page requires."""
    brief = read_brief(DOCS / "examples" / "pipe.toml")
    found = assess(brief.machine, brief.region, brief.criteria, series_size=8, bending=brief.bending)
    (kind,) = re.findall(r"  Type (\w+):", shown("pipe", PAGE))
    assert found.type == kind
    (told,) = re.findall(r"equivalent amplitude ([\d.]+) MPa", shown("pipe", PAGE))
    assert found.bending is not None
    assert 1e-6 * found.bending.nominal.equivalent == pytest.approx(float(told), rel=0.1)


LEFT_OPEN = {"fatigue life": 0.15, "reliability": 0.15, "load rating": 0.15, "bending life": 1.07**5 - 1.0}
"""What chaos leaves open between computers: bending goes by the fifth power of the stress, known to 7 %."""


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_an_example_prints_what_the_page_shows(name, tmp_path):
    """Headline, type and each criterion, within what chaos leaves open between computers; no change is looked for."""
    given, page = run(name, tmp_path, " --verdict-only"), shown(name, PAGE)
    assert given.splitlines()[0] == page.splitlines()[0]
    pattern = r"(?m)^  (fatigue life|bending life|reliability|load rating) +([\d.,e+]+)"
    new, old = (
        {key: float(value.replace(",", "")) for key, value in re.findall(pattern, text)} for text in (given, page)
    )
    assert new.keys() == old.keys()
    for key, value in new.items():
        assert value == pytest.approx(old[key], rel=LEFT_OPEN[key]), key
    assert re.findall(r"  Type (\w+):", given) == re.findall(r"  Type (\w+):", page)
