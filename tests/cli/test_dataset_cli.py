"""The commands around a dataset: what is in it, its card, its map."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.sweeps.card import dataset_card
from chaosgym.machines.accuracy import accuracy_of
from chaosgym.sweeps import read_sweep
from tests.cli.run import run, run_json

SWEEP = (
    "sweep",
    "impact-beam",
    "--axis",
    "damping_ratio=0.01:0.05:log",
    "--axis",
    "excitation_frequency=18:30",
    "--axis",
    "clearance=1e-4:1.4e-4:log",
    "--sampling",
    "crosses:10",
    "--budget",
    "100",
    "--label",
    "full-types=0.3",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small dataset of crosses, made by the command line."""
    path = tmp_path_factory.mktemp("dataset") / "beam"
    assert run(*SWEEP, "--out", str(path))[0] == 0
    return path


def test_info_tells_rows_classes_settings_and_faults(folder):
    """JSON for programs, lines for people."""
    info = run_json("dataset", "info", str(folder))
    assert info["rows"] == {"finished": 50, "planned": 50}
    assert sum(info["classes"]["nature"].values()) == 50
    assert sum(sum(part.values()) for part in info["classes"]["nature_by_split"].values()) == 50
    assert info["faults"]["failed"] == 0
    assert info["types"]["points"] == 5
    assert info["two_step"]["rows"] + info["two_step"]["undetermined"] == 50
    assert info["two_step"]["agreement"] > 0.9
    assert sum(info["classes"]["response_type"].values()) == 10
    _, out, _ = run("dataset", "info", str(folder))
    assert "50 of 50 points, complete" in out


def test_an_unfinished_folder_says_how_far_it_is(folder, tmp_path):
    """Only the plan is there: nothing is finished."""
    (tmp_path / "plan.json").write_text((folder / "plan.json").read_text())
    info = run_json("dataset", "info", str(tmp_path))
    assert (info["complete"], info["rows"]["finished"]) == (False, 0)
    assert "unfinished" in run("dataset", "info", str(tmp_path))[1]


def test_the_error_of_the_one_model_is_that_of_the_machines(folder):
    """A dataset keeps its rung: what is printed of it is the estimate at points of the plan, each by itself."""
    plan, found = read_sweep(folder).plan, run_json("dataset", "info", str(folder))["model"]
    errors = [accuracy_of(machine).error for machine in plan.sample(32)]
    finite = [error for error in errors if error is not None]
    assert found["estimated_error"]["largest"] == max(finite)
    assert found["estimated_error"]["median"] == pytest.approx(np.median(finite))
    assert found["estimated_error"]["estimated"] == len(finite) <= len(errors) == found["estimated_error"]["machines"]
    assert f"- Model: {plan.machine.rung}; {found['told']}." in dataset_card(read_sweep(folder), folder)


def test_card_holds_the_command_that_makes_the_dataset_again(folder):
    """The command in the card, run again, finds the folder complete."""
    card = dataset_card(read_sweep(folder), folder)
    command = next(line for line in card.splitlines() if line.startswith("    chaosgym sweep"))
    code, out, _ = run(*command.split()[1:])
    assert code == 0
    assert "complete, 50 points" in out
    assert "The Two-Step Test alone (`two_step`) and the exponent's sign agree on chaos at " in card
    for heading in ("How it was made", "Class balance", "How far to trust", "Split", "Licence"):
        assert f"## {heading}" in card


def test_cost_is_measured_against_every_axis(folder):
    """Mean cost, cost by axis, and what larger sweeps would take."""
    cost = run_json("sweep-cost", str(folder), "--points", "6", module="benchmarks")
    assert 1e-4 < cost["seconds"] < 10.0
    assert set(cost["by"]) == {"nature", "damping_ratio", "excitation_frequency", "clearance"}
    assert cost["hours"]["1e+09"]["64"] == pytest.approx(1e9 * cost["seconds"] / 64 / 3600)
    code, _, err = run("sweep-cost", str(folder), "--points", "51", module="benchmarks")
    assert code == 2
    assert "3 to 50" in err


def test_map_is_drawn(folder, tmp_path):
    """Crosses and a grid give a picture; an unknown kind of picture is refused."""
    assert run("dataset", "map", str(folder), "--out", str(tmp_path / "m.png"))[0] == 0
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")
    grid = ("sweep", "impact-beam", "--axis", "excitation_frequency=18:30:3", "--axis", "clearance=1e-4:1.4e-4:2")
    run(*grid, "--budget", "100", "--label", "full-types=0", "--out", str(tmp_path / "g"))
    assert run("dataset", "map", str(tmp_path / "g"), "--out", str(tmp_path / "g.png"))[0] == 0
    assert run("dataset", "map", str(folder), "--out", str(tmp_path / "m.xyz"))[0] == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("dataset", "info", "nowhere"), "'nowhere' does not exist"),
        (("dataset", "info", "."), "holds no sweep"),
        (("dataset", "map", ".", "--out", "m.png"), "holds no finished sweep"),
        (("sweep", "impact-beam", "--sampling", "crosses:3:", "--out", "o"), "allowed: grid|random:N"),
        (
            ("sweep", "impact-beam", "--sampling", "crosses:3", "--axis", "length=0.27:0.28", "--out", "o"),
            "crosses need an axis",
        ),
        (
            ("sweep", "impact-beam", "--sampling", "random:3", "--axis", "lenth=0.27:0.28", "--out", "o"),
            "'lenth' is no field",
        ),
        (
            ("sweep", "impact-beam", "--sampling", "random:3", "--label", "signals=2", "--out", "o"),
            "signals = 2 is out",
        ),
        (
            ("sweep", "impact-beam", "--label", "signals=1", "--label", "signals=0", "--out", "o"),
            "signals is stated twice",
        ),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, monkeypatch):
    """Exit code 2, nothing on standard output, nothing written."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert list(Path().iterdir()) == []


def test_check_labels_rows_again(folder):
    """Where the rows were computed they come out the same."""
    found = run_json("check-sweep", str(folder), "--points", "5", "--seed", "3", module="benchmarks")
    assert (found["points"], found["identical"], found["sound"]) == (5, 5, True)
    code, _, error = run("check-sweep", str(folder), "--points", "60", module="benchmarks")
    assert code == 2
    assert "allowed: 1 to 50" in error
