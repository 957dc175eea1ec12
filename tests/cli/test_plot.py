"""Pictures of what commands found: ``--plot`` draws one, and never writes over what the user did not name."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from click.testing import CliRunner
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from chaosgym import ImpactBeam, read_machine
from chaosgym.cli import app
from chaosgym.errors import ChaosgymError
from chaosgym.machines.machine_file import template
from chaosgym.plotting.commands import measured_figure, thumbnails
from chaosgym.plotting.labels import called
from chaosgym.plotting.response import sweep_map
from chaosgym.sweeps import Axis, LabelledSweep, SweepPlan
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


@pytest.mark.filterwarnings("ignore:this policy does not know what was usual")
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


def test_a_machine_is_called_by_the_title_of_its_file(tmp_path):
    """A title says what the machine is; without one the file's name stands."""
    text = template()
    assert 'title = "' in text
    titled, untitled = tmp_path / "a.toml", tmp_path / "press.toml"
    titled.write_text(re.sub(r'^title = ".*"', 'title = "Feeder of line 3"', text, flags=re.MULTILINE))
    untitled.write_text(re.sub(r"^title = .*\n", "", text, flags=re.MULTILINE))
    assert called(read_machine(titled)) == "Feeder of line 3"
    assert called(read_machine(untitled)) == "press"


def test_the_legend_of_a_map_stays_within_it():
    """Of a sweep with every nature and type: all of their names are in the picture."""
    axes = Axis("excitation_frequency", 10.0, 20.0, count=4), Axis("clearance", 1e-4, 2e-4, count=2)
    columns = {
        "excitation_frequency": 2 * [10.0, 13.0, 16.0, 19.0],
        "clearance": 4 * [1e-4] + 4 * [2e-4],
        "nature": [
            "periodic",
            "quasiperiodic",
            "chaotic",
            "undetermined",
            "periodic",
            "periodic",
            "chaotic",
            "chaotic",
        ],
        "response_type": 2 * ["I", "II", "III", "undetermined"],
    }
    plan = SweepPlan(ImpactBeam(), axes)
    figure = sweep_map(LabelledSweep(pa.table(columns), plan.settings()))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (legend,) = figure.legends
    extent = legend.get_window_extent(canvas.get_renderer())
    assert len(legend.get_texts()) == 8
    assert "quasiperiodic" in [text.get_text() for text in legend.get_texts()]
    assert 0.0 <= extent.x0 < extent.x1 <= figure.bbox.x1


def test_headings_of_small_pictures_stay_above_their_own():
    """A long verdict is broken into lines, and the end of a long name of a file is kept."""
    words = "periodic, period 1, if its scatter of 0.77 % is random"
    verdict = SimpleNamespace(nature="periodic", words=words)
    figure = thumbnails([("a-very-long-name-of-a-file-of-line-3.csv, peak", np.ones(9), verdict)] * 3)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    ends = [ax.get_tightbbox(canvas.get_renderer()).x1 for ax in figure.axes]
    assert all(end < ax.bbox.x0 for end, ax in zip(ends[:-1], figure.axes[1:], strict=True))
    assert ends[-1] < figure.bbox.x1
    assert words in figure.axes[0].get_title("left").replace("\n", " ")


def test_a_title_is_broken_where_the_picture_ends():
    """A long name with a long verdict is whole."""
    headline = "periodic, period 1, if its scatter of 0.77 % is random (margin 0.29 of 1)"
    statement = SimpleNamespace(headline=headline)
    verdict = SimpleNamespace(diagnosis=SimpleNamespace(nature="periodic", statement=statement))
    figure = measured_figure(
        SimpleNamespace(
            verdict=verdict,
            peaks=np.arange(9.0),
            unit="N",
            title="vibration of the left bearing of pump 3 in January, " * 2,
        )
    )
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (title,) = [text for text in figure.texts if text.get_text()]
    assert title.get_window_extent(canvas.get_renderer()).x1 <= figure.bbox.x1
    assert headline in title.get_text().replace("\n", " ")
