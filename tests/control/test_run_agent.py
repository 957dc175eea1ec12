"""The command run-agent plays a job beside following the demand, tells what happened, and draws it."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image

from chaosgym.control.controllers import Follow
from chaosgym.control.rollout import play
from chaosgym.machines.machine_file import template
from tests.cli.run import run, run_json
from tests.control.made_up import ENV

pytestmark = pytest.mark.filterwarnings("ignore:this policy does not know what was usual")


def test_a_job_among_many_is_the_job_alone():
    """A machine's job does not depend on those beside it: taken from two it is the one that is played alone."""
    two, alone = (play(Follow(), ENV, machines) for machines in ([3, 4], [4]))
    for name, values in vars(two.job(1)).items():
        np.testing.assert_array_equal(values, vars(alone)[name], err_msg=name)


@pytest.fixture
def few_pictures(monkeypatch):
    """Animations of five pictures."""
    monkeypatch.setattr("chaosgym.plotting.played_job.FRAMES", 5)


@pytest.mark.usefixtures("few_pictures")
def test_a_job_is_played_and_animated(folder, tmp_path):
    """The trim falls to its end and stays, following goes where it is asked; the animation has all its pictures."""
    out = tmp_path / "job.gif"
    told = run_json("run-agent", ENV, "--policy", str(folder), "--machine", "4", "--out", str(out))
    assert told["status"] == told["follow"]["status"] == "job_done"
    trim = np.array(told["speed"]) - told["demand"]
    assert trim[30] == pytest.approx(-2.0)
    assert told["follow"]["demand"] == told["demand"]
    assert told["follow"]["mean_deviation"] < 0.1
    assert len(told["type_iii"]) == len(told["mean_peak_force_N"]) == 120
    with Image.open(out) as animation:
        assert animation.n_frames == 5
    again = run_json("run-agent", ENV, "--policy", str(folder), "--machine", "4")
    assert told.pop("plot") == str(out)
    assert told == again


def test_a_figure_is_drawn_beside_a_table(folder, tmp_path):
    """Every tenth step is a line of the table, and both jobs have one."""
    out = tmp_path / "job.png"
    code, text, _ = run("run-agent", ENV, "--policy", str(folder), "--out", str(out))
    assert code == 0
    assert len(text.splitlines()) == 1 + 12 + 2 + 2 + 1
    with Image.open(out) as figure:
        assert figure.size == (1440, 840)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs ffmpeg")
@pytest.mark.usefixtures("few_pictures")
def test_a_film_is_written(folder, tmp_path):
    """An MP4 file names its type in its first bytes."""
    out = tmp_path / "job.mp4"
    assert run("run-agent", ENV, "--policy", str(folder), "--out", str(out))[0] == 0
    assert out.read_bytes()[4:8] == b"ftyp"


def test_a_level_is_played(folder):
    """Machine 4 of the fleet is another machine than machine 4 of the id; a plant has no level."""
    one, other = (
        run_json("run-agent", ENV, "--policy", str(folder), "--level", level) for level in ("nominal", "fleet")
    )
    assert one["mean_peak_force_N"] != other["mean_peak_force_N"]
    assert "--level is of simulated machines" in run("run-agent", ENV, "--plant", "-", "--level", "fleet")[2]


def test_kriging_plays_where_no_policy_is_shipped(tmp_path):
    """The file of a machine is enough: no training, no model; what it wins is told as life."""
    machine = tmp_path / "own.toml"
    machine.write_text(template())
    told = run_json("run-agent", str(machine))
    assert told["agent"] == "Kriging"
    assert told["life"] == pytest.approx(told["follow"]["damage"] / told["damage"])
    code, text, _ = run("run-agent", str(machine))
    assert code == 0
    assert f"life of the joint: x{told['life']:.2f} against following the demand" in text
    assert " h, " not in text
    assert "life_h" not in told
    ratio = told["follow"]["equivalent_force_N"] / told["equivalent_force_N"]
    assert ratio ** (10.0 / 3.0) == pytest.approx(told["life"], rel=1e-6)
    assert "so kriging played for the joint's life" in text
    rated = run_json("run-agent", str(machine), "--load-rating", "500 N")
    cycles = 1e6 * (500.0 / rated["equivalent_force_N"]) ** (10.0 / 3.0)
    mean_period = np.mean(1.0 / np.array(rated["speed"]))
    assert rated["life_h"][0] == pytest.approx(cycles * mean_period / 3600.0, rel=1e-3)
    assert "by --load-rating 500 N" in run("run-agent", str(machine), "--load-rating", "500 N")[1]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            ("chaosgym/ImpactBeam-v0",),
            "env = 'chaosgym/ImpactBeam-v0' is unknown; did you mean chaosgym/ImpactBeam-v1?",
        ),
        (("chaosgym/Machine-v0", "--policy", "{folder}"), "machine = '' does not exist"),
        (("CartPole-v1",), "is unknown"),
        (("gone.toml", "--policy", "{folder}"), "gone.toml can't be read"),
        ((ENV, "--policy", "nowhere"), "nowhere holds no policy.json"),
        ((ENV, "--memory", "memory.npz"), "--memory is of one plant; give --plant MODULE:CLASS or --fmu FILE too"),
        (
            (ENV, "--plot", "job.tex"),
            "job.tex is no name of a picture; allowed: names that end in .png, .svg, .pdf, .gif, .mp4",
        ),
    ],
)
def test_wrong_input_ends_in_one_line(arguments, complaint, folder):
    """Exit code 2, and what is allowed."""
    code, _, err = run("run-agent", *(argument.format(folder=folder) for argument in arguments))
    assert code == 2
    assert complaint in err
    assert len(err.strip().splitlines()) <= 3


def test_a_policy_of_another_machine_is_refused(folder):
    """The message names the environment of the policy."""
    code, _, err = run("run-agent", "chaosgym/SliderCrank-v1", "--policy", str(folder))
    assert code == 2
    assert f"trained on {ENV}" in err


def test_the_numbers_are_json(folder):
    """No value is NaN, which JSON has not."""
    json.dumps(run_json("run-agent", ENV, "--policy", str(folder)), allow_nan=False)
