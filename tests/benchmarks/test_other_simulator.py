"""A beam behind the plant interface is the beam of an environment; jobs are kept, and make the table."""

import json
from pathlib import Path
from shutil import copy

import numpy as np
import pytest

from benchmarks.envs.other_simulator import PLAYERS, SIMULATORS, Rig, job, lines, other_simulator
from chaosgym.envs.vector_env import native_envs

DOCS = Path(__file__).parents[2] / "docs"

ENV = "chaosgym/ImpactBeamTolerance-v1"
IDEAL = {"speed_ripple": 0.0, "sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0, "tolerances": {}}


@pytest.mark.parametrize("speed", [19.0, 23.0])
def test_a_rig_is_the_job_of_an_environment(speed):
    """Without ripple and errors: peaks, impacts, bouncing, irregular cycles and damage, while the clearance grows."""
    envs = native_envs(ENV, 1, action="speed", wear=0.5, **IDEAL)
    seen, _ = envs.reset(seed=0, options={"speed": speed})
    rig = Rig(SIMULATORS["chaosgym"], envs.nominal, envs.task, seed=0)
    rig.reset()
    told = rig.run(speed, envs.task.run_in_cycles)
    for step in range(4):
        assert np.mean(told["peaks"][-10:]) == pytest.approx(seen[0, 6], rel=1e-6)
        assert step == 0 or [told["impacts"], told["bouncing"]] == pytest.approx(seen[0, 12:], rel=1e-5)
        seen, _, _, _, info = envs.step(np.full((1, 1), speed, np.float32))
        told = rig.run(speed, 10)
        assert rig.irregular[-1] == info["type_iii"][0]
        assert rig.damage == pytest.approx(info["damage"][0], rel=1e-9)


@pytest.fixture
def kept(tmp_path):
    """Jobs that cost 3 in our simulator and 1 more in Exudyn, on machine 1 twice as much."""
    path = tmp_path / "jobs.jsonl"
    with path.open("w") as file:
        for k in range(2):
            for player in PLAYERS:
                for simulator in SIMULATORS:
                    lost = (3.0 + (simulator == "Exudyn")) * (1 + k)
                    told = {"return": -lost, "type_iii": 0.25, "deviation": 0.5, "damage": lost / 100.0}
                    print(json.dumps([k, player, simulator, told]), file=file)
    return path


def test_jobs_of_a_file_are_not_played_again(kept):
    """The table is that of the file: means of 4.5 and 6 lost, and a difference between 1 and 2."""
    before = kept.read_bytes()
    found = other_simulator(2, 1, kept)
    assert kept.read_bytes() == before
    assert [row["player"] for row in found] == list(PLAYERS)
    rows = "| 2 | -4.5, 25.0%, 0.50 Hz, x1.00 | -6.0, 25.0%, 0.50 Hz, x1.00 | **-1.5 (-2.0 to -1.0)** |"
    assert all(line.endswith(rows) for line in lines(found)[2:])


def test_the_page_has_the_table_of_the_jobs_that_are_kept(tmp_path):
    """Of all of them."""
    page = (DOCS / "controllers.md").read_text()
    kept = Path(copy(DOCS / "data" / "other-simulator.jsonl", tmp_path))
    table = lines(other_simulator(24, 1, kept))
    assert "\n".join(table) in page


@pytest.mark.slow
def test_a_job_that_is_missing_is_played_and_kept(kept):
    """The file of a run that was stopped gets what is missing, as ``job`` plays it."""
    given = (1, "kriging, life", "chaosgym")
    rows = kept.read_text().splitlines()
    missing = [row for row in rows if json.loads(row)[:3] == list(given)]
    kept.write_text("".join(f"{row}\n" for row in rows if row not in missing))
    other_simulator(2, 1, kept)
    *_, last = map(json.loads, kept.read_text().splitlines())
    assert last == [*given, job(given)]
