"""The benchmark measures what it says, and peers run the same machines."""

import json
import math
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from benchmarks.cli import app
from benchmarks.performance import mechanisms, rates, sizes
from benchmarks.performance.against_exudyn import FOUR_BAR, Contest, against_exudyn, period_of
from benchmarks.performance.exudyn_machines import ExudynSetting, run_in_exudyn
from benchmarks.performance.peers import peers
from benchmarks.performance.timing import processor_seconds, rate
from benchmarks.performance.waits import waits
from chaosgym import read_machine
from chaosgym.envs.exudyn_beam import load_exudyn
from chaosgym.errors import ChaosgymError
from chaosgym.simulation import simulate
from tests.plain_modes import PLAIN_BEAM, PLAIN_CRANK

BEAM_30 = replace(PLAIN_BEAM, excitation_frequency=30.0, clearance=0.127e-3)


def test_a_rate_counts_units_of_work() -> None:
    """Twice the units in the same time is twice the rate; processor time does not run while nothing is computed."""

    def doze() -> int:
        time.sleep(0.02)
        return 10

    measured = rate(doze, 3)
    assert 50.0 < measured.per_second <= 500.0
    assert measured.per_processor_second > 2.0 * measured.per_second
    assert processor_seconds(lambda: time.sleep(0.05)) < 0.04


def test_figures_stand_beside_those_of_another_commit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What one run printed as JSON is shown beside the next, by name and as a ratio; what it lacks ends in one line."""
    stored = tmp_path / "then.json"
    monkeypatch.setattr("benchmarks.performance.set_up_times", lambda _: {"a speed": 2.0, "a machine": 3.0})
    then = CliRunner().invoke(app, ["bench", "--set-up", "--json"])
    stored.write_text(json.dumps(json.loads(then.stdout) | {"commit": "abc1234"}))
    monkeypatch.setattr("benchmarks.performance.set_up_times", lambda _: {"a speed": 5.0, "another": 1.0})
    beside = ["bench", "--set-up", "--beside", str(stored)]
    head, *rows = CliRunner().invoke(app, beside).stdout.splitlines()
    assert head.split()[-2:] == ["abc1234", "ratio"]
    assert [row.split() for row in rows] == [["set_up_microseconds,", "a", "speed", "5", "2", "2.50"]]
    told = json.loads(CliRunner().invoke(app, [*beside, "--json"]).stdout)
    assert told["figures"] == {"set_up_microseconds, a speed": {"now": 5.0, "then": 2.0}}
    for text, reason in (
        ('{"commit": "abc1234"}', "none of these figures"),
        ("[", "can't be read"),
        ("[1]", "no JSON"),
    ):
        stored.write_text(text)
        refused = CliRunner().invoke(app, beside)
        assert refused.exit_code == 2
        assert reason in refused.output


def test_every_rate_comes_out_positive(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command prints one JSON object with finite rates by name, ours beside CartPole."""
    monkeypatch.setattr(rates, "SUB_ENVIRONMENTS", 2)
    monkeypatch.setattr(rates, "SWEEP_POINTS", 1)
    monkeypatch.setattr(rates, "RANGE", rates.RANGE[:2])
    monkeypatch.setattr(rates, "STEPS", dict.fromkeys(rates.STEPS, (2, 1)))
    monkeypatch.setattr(rates, "_points", lambda: {name: (m, i, 2) for name, (m, i, _) in list(_points().items())[:1]})
    monkeypatch.setattr(rates, "sweep_rate", lambda machine, repeats: rate(lambda: 1, repeats))
    run = CliRunner().invoke(app, ["bench", "--repeats", "1", "--json"])
    assert run.exit_code == 0, run.output
    result = json.loads(run.stdout)
    assert set(result["env_steps"]) >= {"chaosgym/ImpactBeam-v1", "chaosgym/SliderCrank-v1", "CartPole-v1"}
    assert set(result["vector_env_steps"]) == set(result["env_steps"])
    for cost in result["step_microseconds"].values():
        assert 0.0 < cost["warm"] < cost["python"] < cost["step"]
    figures = [
        figure
        for quantity, named in result.items()
        if quantity not in ("load_average", "commit", "in_loops")
        for both in named.values()
        for figure in both.values()
    ]
    assert len(figures) >= 16
    assert all(loops > 0.0 for loops in result["in_loops"].values())
    assert len(result["in_loops"]) == 1 + len(result["step_microseconds"])
    mean, cheapest, dearest = (both["per_processor_second"] for both in result["range"].values())
    assert dearest <= mean <= cheapest
    assert all(math.isfinite(figure) and figure > 0.0 for figure in figures)


def test_what_grows_is_measured_and_drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Every size has a cost and a memory, and of two gaps there are more tables than of one."""
    for name, fewer in (("MODES", (2,)), ("STIFFNESS", (1e6,)), ("GAPS", (1, 2)), ("CYCLES", (9,)), ("MACHINES", (2,))):
        monkeypatch.setattr(sizes, name, fewer)
    monkeypatch.setattr(sizes, "TIMED", 30)
    picture = tmp_path / "scaling.png"
    run = CliRunner().invoke(app, ["bench", "--scaling", "--repeats", "1", "--json", "--figure", str(picture)])
    assert run.exit_code == 0, run.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    grown = json.loads(run.stdout)["sizes"]
    assert all(size["microseconds"] > 0.0 and size["kept"] > 0.0 for size in grown)
    one, two = (size["kept"] for size in grown if size["grows"] == "gaps")
    assert two > one
    assert json.loads(run.stdout)["processors"][0]["number"] == 1


def test_mechanisms_are_timed_against_the_crank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every mechanism costs some cycles of the crank, one that slides less than one that rolls in a round hole."""
    monkeypatch.setattr(mechanisms, "SETTLED", 2)
    monkeypatch.setattr(mechanisms, "BLOCK", 5)
    run = CliRunner().invoke(app, ["bench", "--mechanisms", "--repeats", "1", "--json"])
    assert run.exit_code == 0, run.output
    result = json.loads(run.stdout)
    ratios = {row["machine"]: row["ratio"] for row in result["cycles"]}
    assert set(ratios) == set(mechanisms.CYCLES)
    assert 0.0 < ratios["slider-crank-flores-guide"] < ratios["four-bar-akhadkar"]
    assert set(result["assembly_milliseconds"]) == set(mechanisms.ASSEMBLY)
    assert all(value > 0.0 for value in result["assembly_milliseconds"].values())


_points = rates._points


@pytest.mark.slow
def test_a_sweep_is_timed() -> None:
    """Points per second of a whole sweep, labels and files included."""
    assert rates.sweep_rate(PLAIN_BEAM, 1).per_second > 0.5


def test_periods_of_peaks() -> None:
    """A response that cycles among p peaks within the tolerance has period p; noise beyond it has none."""
    for period in range(1, 9):
        peaks = np.resize(10.0 * np.arange(1, period + 1), 50)
        assert period_of(peaks + 0.2 * np.sin(np.arange(50)), 0.5) == period
    assert period_of(np.random.default_rng(0).uniform(0.0, 10.0, 50), 0.5) == 0


def test_without_exudyn_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """The peers are an extra."""
    monkeypatch.setitem(sys.modules, "exudyn", None)
    with pytest.raises(ChaosgymError, match="pip install exudyn"):
        load_exudyn()


@pytest.mark.parametrize(
    "setting", [ExudynSetting("RK44", "law", 1e-5), ExudynSetting("GeneralizedAlpha", "stop", 2e-6, 1e-4)], ids=str
)
def test_exudyn_integrates_the_same_beam(setting: ExudynSetting) -> None:
    """The first peak forces, before small differences have grown, agree within 1 %."""
    pytest.importorskip("exudyn")
    seconds, peaks = run_in_exudyn(BEAM_30, 2, setting, forces=True)
    assert seconds > 0.0
    assert peaks == pytest.approx(simulate(BEAM_30, 2).peak_force[:, 0], rel=0.01)


def test_exudyn_builds_the_same_crank() -> None:
    """Tight in the guide, the slider's side force over a revolution is that of our mechanism within 0.1 %."""
    pytest.importorskip("exudyn")
    crank = replace(PLAIN_CRANK, crank_speed=300.0, slider_clearance=0.0, contact_damping_ratio=1.0)
    _, peaks = run_in_exudyn(crank, 2, ExudynSetting("TrapezoidalIndex2", "stop", 2e-5, 1e-4), forces=True)
    assert peaks is not None
    assert peaks[1] == pytest.approx(simulate(crank, 2).peak_force[1, 0], rel=1e-3)


def test_exudyn_builds_the_same_four_bar() -> None:
    """Forces of a loose pin from the nominal motion on agree within 0.1 %: links that turn by any angle are its own."""
    pytest.importorskip("exudyn")
    machine = read_machine(FOUR_BAR)
    _, peaks = run_in_exudyn(machine, 3, ExudynSetting("TrapezoidalIndex2", "law", 2e-5), forces=True)
    assert peaks == pytest.approx(simulate(machine, 3).peak_force.max(axis=1), rel=1e-3)


def test_a_contest_reports_speed_beside_verdict() -> None:
    """At 10 Hz both find period 1; the ratio is that of the two rates."""
    pytest.importorskip("exudyn")
    contest = Contest(
        machine=BEAM_30,
        speeds=(10.0,),
        settings=(ExudynSetting("RK44", "law", 1e-5),),
        cycles=60,
        judged=20,
        timed=5,
        reference_cycles=80,
        repeatability=0.5,
        goal=80.0,
    )
    row: dict[str, Any] = against_exudyn([contest], repeats=1)[0]
    rates_of = row["cycles_per_processor_second"]
    assert row["ratio"] == pytest.approx(rates_of["chaosgym"] / rates_of["exudyn"])
    for side in ("chaosgym", "exudyn"):
        assert (row["right_class"][side], row["right_period"][side], row["wrong_at"][side]) == (1, 1, [])
    assert row["mean_peak_force"]["exudyn"] == pytest.approx(row["mean_peak_force"]["chaosgym"], rel=0.02)


def test_other_programs_move_the_same_beam() -> None:
    """Every program's first peak is that of exact events to its accuracy; equal methods of equal step agree beyond it.

    Those that are not installed are named. They run in a process of their own: JAX warns at every fork after its use.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as own:
        found = {each.name: each for each in own.submit(peers, (30.0,), 2).result()}
    errors = {name: each.error for name, each in found.items() if "not installed" not in name}
    assert errors.pop("chaosgym, exact events") < 1e-9
    assert 1e-6 < min(errors.values()) <= max(errors.values()) < 0.01
    same = [error for name, error in errors.items() if "10 us" in name]
    assert np.ptp(same) < 1e-2 * same[0]
    assert all(math.isnan(each.error) for name, each in found.items() if "not installed" in name)


def test_what_people_wait_for_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """A type takes no less than a nature; a batch keeps more than the states of its machines, and shares tables."""
    monkeypatch.setattr("benchmarks.performance.waits.POINTS", 3)
    found = waits(1)
    assert all(value > 0.0 for value in found.values())
    assert found["classify a random beam, types"] > 0.5 * found["classify a random beam, nature"]
    assert 8 * PLAIN_BEAM.n_states < found["memory, bytes a machine of a batch"] < 10_000
