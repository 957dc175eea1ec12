import json
import math

import numpy as np
import pytest

import chaosgym
from benchmarks.agreement import agreement, random_machines
from chaosgym import Drive, ModalMachine, Structure
from chaosgym.branches.margins import margins_of
from chaosgym.diagnosis import diagnose
from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.machines.parameters import with_settings
from chaosgym.series.verdict import escape_rate
from chaosgym.simulation import RungeKutta4, simulate
from tests.diagnosis.machine_files import DYING, NEARING, SOFT, held_by_friction, written
from tests.plain_modes import PLAIN_BEAM


@pytest.mark.parametrize(("frequency", "period"), [(10.0, 1), (19.0, 1), (22.0, 4)])
def test_periodic_responses_are_certified(frequency, period):
    """Newton's method proves the orbits at 10, 19 and 22 Hz within 200 cycles; their exponents are negative."""
    verdict = diagnose(PLAIN_BEAM.at(frequency))
    assert (verdict.nature, verdict.period, verdict.status) == ("periodic", period, "certified")
    assert verdict.horizon <= 200
    assert verdict.evidence["orbit"]["residual"] < 1e-10
    assert verdict.evidence["largest_lyapunov_exponent_per_cycle"]["value"] < 0.0
    assert verdict.settle_cycle is not None
    assert json.dumps(verdict.as_dict())


def test_what_soon_repeats_is_proven_at_once():
    """At 10 Hz 16 cycles are enough; label and peak are those of the stages that start at 100 cycles."""
    beam = ImpactBeam(excitation_frequency=10.0)
    early = diagnose(beam)
    late = diagnose(beam, integrator=RungeKutta4(8000))
    assert (early.nature, early.period, early.status, early.horizon) == ("periodic", 1, "certified", 16)
    assert (late.nature, late.period, late.horizon) == ("periodic", 1, 100)
    assert early.evidence["largest_peak"] == pytest.approx(late.evidence["largest_peak"], rel=1e-3)
    assert early.votes == {"two_step": "periodic", "lyapunov": "periodic", "newton": "periodic"}


def two_masses(speed, preload):
    """Masses of 1 and 3 kg, each on 2 kN/m, with a gap between them; a force of 20 N shakes the larger."""
    structure = Structure.of_matrices(
        np.diag([1.0, 3.0]), np.diag([2000.0, 2000.0]), 0.02, {"load": 0, "motor": 1}, modes=2
    )
    drives = (Drive.sine("force", "motor", 20.0),)
    joint = {"contact_stiffness": 5e5, "contact_damping": 30.0, "clearance": 0.2e-3, "preload": preload}
    return ModalMachine(modes=structure, joint="load - motor", drives=drives, speed=speed, **joint)


@pytest.mark.parametrize(("speed", "preload"), [(22.0, 0.0), (33.0, 0.0), (40.0, 2.0), (45.0, 2.0)])
def test_forces_of_a_proven_orbit_are_those_of_a_run_that_has_settled(speed, preload):
    """A proof needs no settled run; what the verdict shows on each surface is the motion after 3,000 more cycles.

    Clearances that differ by up to 1e-7 give the same verdict: at other speeds chaos at first lets a rounding of the
    model decide when it ends, and on which orbit.
    """
    machine = two_masses(speed, preload)
    verdict = diagnose(machine)
    assert verdict.status == "certified"
    settled = simulate(machine, verdict.period, verdict.evidence["final_state"], transient=3000 * verdict.period)
    reached = verdict.judged.peak_force
    assert len(reached) % verdict.period == 0
    np.testing.assert_allclose(np.sort(np.unique(reached[:, 0].round(6))), np.unique(settled.peak_force[:, 0].round(6)))
    np.testing.assert_allclose(reached.max(axis=0), settled.peak_force.max(axis=0), rtol=1e-6)
    assert verdict.evidence["largest_peak"] == reached.max()


def test_step_two_is_finished_and_votes_on_chaos():
    """Where the exponent shows chaos, step II has looked at section and spectrum too, and agrees (5.2.1)."""
    verdict = diagnose(ImpactBeam(), budget=400)
    votes = {name: verdict.votes[name] for name in ("two_step", "lyapunov", "zero_one")}
    assert votes == {"two_step": "chaotic", "lyapunov": "chaotic", "zero_one": "chaotic"}
    assert verdict.evidence["section"] == "set with structure"
    assert "exponent" in verdict.reason
    assert "broad spectrum" in verdict.reason


def test_chaos_of_the_beam_is_agreed():
    """At 30 Hz and +-0.127 mm every test says chaos, and the exponent exceeds three standard errors."""
    verdict = diagnose(ImpactBeam(), budget=400)
    assert (verdict.nature, verdict.status, verdict.horizon) == ("chaotic", "agreed", 400)
    exponent = verdict.evidence["largest_lyapunov_exponent_per_cycle"]
    assert exponent["value"] > 3.0 * exponent["standard_error"] > 0.0
    assert set(verdict.votes.values()) <= {"chaotic", "undetermined"}


def test_the_nature_is_that_of_the_settled_motion():
    """A beam that is chaotic for some 76 cycles, then of period 3; by the thesis' naming (5.2.3) it is chaotic."""
    fields = {"excitation_frequency": 27.2, "clearance": 0.158e-3, "damping_ratio": 0.028}
    verdict = diagnose(with_settings(PLAIN_BEAM, fields))
    assert (verdict.nature, verdict.status, verdict.period) == ("periodic", "certified", 3)
    assert 50 < verdict.transient_chaos <= verdict.settle_cycle < verdict.horizon
    assert verdict.words == f"periodic, period 3, after {verdict.transient_chaos} cycles of transient chaos"
    label = verdict.labelled("thesis")
    assert (label.nature, label.status, label.period, label.margin) == ("chaotic", "transient", 3, verdict.margin)
    assert label.reason == f"transient chaos for {verdict.transient_chaos} cycles; then {verdict.reason}"
    assert label.words == f"chaotic for {verdict.transient_chaos} cycles, then period 3"
    assert verdict.labelled("settled") is verdict


def test_a_motion_that_ends_without_contact_is_not_chaotic(tmp_path):
    """Against a soft stop a mode rattles chaotically, then never touches again: its decay is that of its damping."""
    machine = chaosgym.read_machine(written(tmp_path, SOFT)).at(speed=0.8)
    starts = np.random.default_rng(3).uniform(-1.0, 1.0, (12, 2)) * [3e-3, 2e-2]
    verdicts = [diagnose(machine, initial_state=start) for start in starts]
    free = [one for one in verdicts if one.evidence["linear"] and one.transient_chaos]
    assert free, "which of its motions chaos leaves it to hangs on rounding, but not for twelve starts"
    for verdict in free:
        assert verdict.nature == "periodic"
        assert verdict.words == (
            f"periodic, period 1, without contact, after {verdict.transient_chaos} cycles of transient chaos"
        )
        assert verdict.orbit.largest_multiplier == pytest.approx(math.exp(-0.01 * 2.0 * math.pi / 0.8), rel=1e-6)
        later = chaosgym.simulate(machine, 100, verdict.run.final_state)
        assert not later.peak_force.any()
    assert margins_of(machine, free[0]).largest_multiplier == pytest.approx(free[0].orbit.largest_multiplier)


def test_one_criterion_tells_transient_chaos_from_a_start(tmp_path):
    """Chaos before an orbit that is proven while the motion still nears it counts as that before one that repeats.

    Its orbit of period 7 attracts by a factor of 0.936 a period.
    """
    verdict = diagnose(chaosgym.read_machine(written(tmp_path, NEARING)))
    assert (verdict.nature, verdict.period) == ("periodic", 7)
    assert 50 < verdict.transient_chaos < verdict.settle_cycle
    assert "of transient chaos" in verdict.words


def test_chaos_is_told_for_at_least_the_cycles_that_were_seen():
    """Without an escape in N cycles its rate is at most 3/N, the root of exp(-x N) = 0.05 to a part in 500."""
    verdict = diagnose(ImpactBeam(), budget=400)
    assert verdict.words == "chaotic for at least 400 cycles"
    assert escape_rate(400) == pytest.approx(-math.log(0.05) / 400, rel=2e-3)
    assert "at a rate of at most 7.5e-03 a cycle" in verdict.statement.horizon
    assert "a budget of 1600 cycles" in verdict.statement.tells_more
    longer = diagnose(ImpactBeam(), budget=1600)
    assert verdict.margin == pytest.approx(math.log10(400 / 150) / 2.0)
    assert longer.margin == pytest.approx(math.log10(1600 / 150) / 2.0)
    assert verdict.labelled("thesis").margin == 1.0, "of the exponent alone"


def test_chaos_that_dies_out_later_is_not_called_certain(tmp_path):
    """One mode between two stops, driven by the third harmonic: chaotic for some 10,000 cycles, then periodic."""
    machine = chaosgym.read_machine(written(tmp_path, DYING))
    short = diagnose(machine, budget=400)
    assert short.words == "chaotic for at least 400 cycles"
    assert short.margin < 0.25
    long = diagnose(machine, budget=51200)
    assert (long.nature, long.status) == ("periodic", "certified")
    assert long.transient_chaos > 400


@pytest.mark.parametrize("force", ["1 N", "0 N"])
def test_what_friction_holds_is_neutral(tmp_path, force):
    """Pressed together and held by friction, a machine has a multiplier of 1: it stays where it is put, and is no more.

    Without a drive it is at rest.
    """
    machine = chaosgym.read_machine(written(tmp_path, held_by_friction(force)))
    verdict = diagnose(machine)
    assert verdict.words == ("periodic, period 1, neutral" if force == "1 N" else "at rest under the load")
    assert (verdict.status, verdict.nature) == ("agreed", "periodic")
    assert verdict.orbit.neutral
    assert not verdict.orbit.certified
    assert abs(verdict.orbit.largest_multiplier - 1.0) < 1e-9
    assert margins_of(machine, verdict) is None
    beside = diagnose(machine, initial_state=np.asarray(verdict.evidence["final_state"]) * 1.001)
    assert beside.orbit.neutral
    assert np.max(np.abs(beside.orbit.state - verdict.orbit.state)) > 0.0, "another of the family"


def test_a_long_period_is_proven_where_recurrence_does_not_look():
    """At 26.6 Hz a long transient locks on 34 cycles; at 28.6 Hz it settles on one cycle."""
    assert diagnose(PLAIN_BEAM.at(26.6), budget=1600).period == 34
    slow = diagnose(PLAIN_BEAM.at(28.6), budget=25600)
    assert slow.period == 1
    assert slow.transient_chaos > 50


def test_chaos_within_the_sensor_error_counts_as_periodic_on_request():
    """At 180 rpm, +-0.032 mm and 2.5 % the crank is chaotic by 2.3 N: periodic to a sensor with an error of 3 N."""
    crank = SliderCrank(crank_speed=180.0, slider_clearance=0.032e-3, contact_damping_ratio=0.025)
    assert diagnose(crank, budget=200).nature == "chaotic"
    seen = diagnose(crank, budget=200, sensor_error=3.0)
    assert seen.nature == "periodic"
    assert "exactly" in seen.reason
    assert diagnose(ImpactBeam(), budget=200, sensor_error=3.0).nature == "chaotic"


def test_the_initial_state_is_part_of_the_label():
    """A start on the settled orbit settles at once and says where it started."""
    beam = ImpactBeam(excitation_frequency=10.0)
    first = diagnose(beam)
    second = diagnose(beam, initial_state=first.evidence["final_state"])
    assert first.evidence["initial_state"] == "rest"
    assert second.evidence["initial_state"] == first.evidence["final_state"]
    assert second.settle_cycle == 0


def test_a_budget_below_the_first_stage_is_refused():
    """The error names the range."""
    with pytest.raises(DiagnosisError, match="whole numbers from 100 to"):
        diagnose(ImpactBeam(), budget=50)


def test_agreement_of_all_tests_on_a_few_beams():
    """On six random beams long tests agree with the reference; the table adds up and draws the same machines again."""
    machines = random_machines(ImpactBeam(), 6, seed=3)
    assert machines == random_machines(ImpactBeam(), 6, seed=3)
    table = agreement(machines, reference_cycles=2000, budget=800)
    assert sum(table.reference.values()) == table.points == 6
    assert np.allclose(np.diag(table.pairwise), 1.0)
    rows = {row.test: row for row in table.rows}
    assert rows["Two-Step Test, 1000 + 1000"].agreement == 1.0
    assert rows["diagnose, up to 800"].agreement == 1.0
    assert table.markdown().count("\n") == len(table.rows) + 3
    assert json.dumps(table.as_dict())
