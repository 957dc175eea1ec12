"""Pictures of what commands found: ``--plot`` draws one, and never writes over what the user did not name."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from chaosgym.cli import app
from chaosgym.errors import ChaosgymError
from tests.control.made_up import ENV


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Every test works in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(*arguments):
    """JSON object of a command that must succeed."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def marks(path):
    """Share of a picture that is not its background."""
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("L"))
    assert min(pixels.shape) >= 400, "too small for a paper"
    return float(np.mean(pixels < 200))


@pytest.fixture
def peaks(here):
    """A record that repeats every second cycle, and one that does not."""
    generator = np.random.default_rng(0)
    rows = np.column_stack([50.0 + 5.0 * (np.arange(600) % 2), 50.0 + 20.0 * generator.random(600)])
    Path("peaks.csv").write_text("calm [N],wild [N]\n" + "\n".join(f"{a:.3f},{b:.3f}" for a, b in rows))
    return "peaks.csv"


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "impact-beam", "--cycles", 30),
        ("simulate", "impact-beam", "--clearance-mm", 100, "--cycles", 1),
        ("diagnose", "impact-beam", "--frequency-hz", 19),
        ("diagnose", "impact-beam", "--frequency-hz", 30, "--budget", 100),
        ("judge", "peaks.csv", "--column", "calm", "--sensor-error", 1),
        ("classify", "impact-beam", "peaks.csv", "--sensor-error", 1),
        ("judge", "peaks.csv", "--column", "wild", "--load-rating", 500),
    ],
)
def test_a_picture_is_drawn_into_a_new_file(command, peaks):
    """It is not blank; the second time it has a name of its own, and the first one stays as it was."""
    first = told(*command, "--plot")["plot"]
    held = Path(first).read_bytes()
    assert 0.005 < marks(first) < 0.6
    second = told(*command, "--plot")["plot"]
    assert second != first
    assert Path(first).read_bytes() == held == Path(second).read_bytes(), "the same result gives the same bytes"


@pytest.mark.parametrize(
    "axes", [("clearance=1e-4:1.3e-4:3",), ("excitation_frequency=18:30:3", "clearance=1e-4:1.3e-4:2")]
)
def test_a_sweep_is_drawn_along_one_field_or_over_two(axes):
    """Forces along one field, a map over two; the file that was named is written."""
    given = [word for axis in axes for word in ("--axis", axis)]
    assert told("sweep", "impact-beam", *given, "--budget", 100, "--out", "s", "--plot", "s.svg")["plot"] == "s.svg"
    text = Path("s.svg").read_text()
    assert "<svg" in text
    assert len(text) > 5000


def test_an_agent_is_drawn(folder):
    """The picture of a job, in a new file by its environment."""
    assert told("run-agent", ENV, "--policy", folder, "--plot")["plot"] == f"run-agent-{ENV.rpartition('/')[2]}.png"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("simulate", "--plot", "impact-beam"), "Missing argument"),
        (("simulate", "impact-beam", "--plot", "x.doc"), "allowed: names that end in .png, .svg, .pdf"),
        (("simulate", "impact-beam", "--plot", "nowhere/x.png"), "nowhere is no folder"),
        (("classify", "impact-beam", "--plot"), "need one: classify impact-beam FILE"),
        (("design", "brief.toml", "--plot", "x.doc"), "allowed: names that end in .png, .svg, .pdf"),
    ],
)
def test_a_wrong_name_is_refused_before_anything_runs(arguments, message):
    """The message says what is allowed, and nothing is written."""
    result = CliRunner().invoke(app, arguments)
    known = str(result.exception) if isinstance(result.exception, ChaosgymError) else result.output
    assert result.exit_code in (1, 2)
    assert message in known
    assert list(Path().iterdir()) == []


def test_nothing_is_drawn_without_being_asked(here):
    """No file, and no entry in the answer."""
    assert "plot" not in told("simulate", "impact-beam", "--cycles", 2)
    assert list(here.iterdir()) == []
