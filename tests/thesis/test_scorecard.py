"""The scorecard runs what the thesis ran, and runs it once."""

import json
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.diagnosis import two_step_test
from chaosgym.machines import THESIS_IMPACT_BEAM, THESIS_SLIDER_CRANK
from chaosgym.simulation import simulate
from thesis.scorecard.beam_runs import force_point_motion, long_run
from thesis.scorecard.crank_runs import median_angles
from thesis.scorecard.jobs import Job, observation, run_jobs
from thesis.scorecard.observation import QUICK, READING_ERROR, THOROUGH, Effort, Observation, observe, plotted_peaks
from thesis.scorecard.quantities import QUANTITIES, clearance_unit
from thesis.scorecard.response_quantities import RESPONSE_QUANTITIES
from thesis.scorecard.scorecard import evaluate
from thesis.scorecard.verdicts import judge
from thesis.statements import read_comparisons

COMPARED = {one.id: one for one in read_comparisons().compared}


def curve(natures, forces):
    """Results of observation jobs along an axis."""
    return [
        Observation(nature=nature, exact_nature=nature, low=force, mean=force, high=force).as_dict()
        for nature, force in zip(natures, forces, strict=True)
    ]


def test_beam_scales_and_natures_are_those_of_the_thesis():
    """Chaos at 30 Hz, the dimensionless clearance of 0.127 mm, the frequency at 284.0 mm: hit by the thesis' beam."""
    wanted = [COMPARED[name] for name in ("IBS-014", "IBS-017", "IBS-034")]
    judged = evaluate(wanted, {"impact-beam": THESIS_IMPACT_BEAM}, efforts=THOROUGH)
    assert [one.verdict for one in judged] == ["hit", "hit", "hit"]


def test_dots_closer_than_the_width_of_a_dot_are_one():
    """A spread below 1 N reads as periodic from a figure; without the reading error the same run is judged exactly."""
    seen = observe(replace(THESIS_IMPACT_BEAM, excitation_frequency=30.0, clearance=0.127e-3), Effort(100, 60, 0))
    assert not seen.is_periodic
    assert seen.low < seen.mean < seen.high
    quiet = observe(replace(THESIS_IMPACT_BEAM, excitation_frequency=6.0, clearance=0.03175e-3), Effort(60, 60, 0))
    assert quiet.is_periodic
    assert quiet.high - quiet.low < 1.0


def test_dots_are_the_series_that_the_thesis_plots():
    """One side of the beam's bearing, the resultant of the crank's joint: by them nature and forces are read.

    At 20 Hz and +-0.032 mm the beam's upper side repeats within a dot and the lower one does not; at 100 rpm and 2.5 %
    contact damping the slider's upper side varies and the larger of both sides repeats.
    """
    beam = replace(THESIS_IMPACT_BEAM, excitation_frequency=20.0, clearance=0.03175e-3)
    record = simulate(beam, 300).after(200)
    assert np.array_equal(plotted_peaks(record), record.peak_force[:, 0])
    assert two_step_test(record, sensor_error=READING_ERROR).nature != "periodic"
    assert observe(beam, THOROUGH["impact-beam"]).nature == "periodic"
    crank = replace(THESIS_SLIDER_CRANK, crank_speed=100.0, slider_clearance=0.03175e-3, contact_damping_ratio=0.025)
    record = simulate(crank, 110).after(60)
    assert np.array_equal(plotted_peaks(record), record.peak_force.max(axis=1))
    assert np.ptp(record.peak_force[:, 0]) > 2.0 * READING_ERROR
    seen = observe(crank, THOROUGH["slider-crank"])
    assert (seen.nature, seen.low) == ("periodic", record.peak_force.max(axis=1).min())


def test_dots_that_spread_beyond_the_reading_error_are_chaos():
    """At 170 rpm and 2.5 % the 50 dots spread over 3 N: the nature is told from them, as the thesis told it."""
    crank = replace(THESIS_SLIDER_CRANK, crank_speed=170.0, slider_clearance=0.03175e-3, contact_damping_ratio=0.025)
    seen = observe(crank, THOROUGH["slider-crank"])
    assert (seen.nature, seen.period, seen.settle_cycle) == ("chaotic", None, None)
    assert seen.high - seen.low > 3.0


def test_type_one_ends_where_the_force_first_falls():
    """Forces that rise to 8 Hz and fall at 9 end Type I at 8 Hz; so does a response that is not periodic."""
    comparison = COMPARED["IBS-020"]
    rising = [10.0 + n for n in range(8)]
    natures = ["periodic"] * 30
    smooth_end = RESPONSE_QUANTITIES["smooth_end"].finding
    falls = curve(natures, rising + [16.0] * 22)
    assert smooth_end(THESIS_IMPACT_BEAM, comparison, falls).value == 8.0
    breaks = curve(natures[:8] + ["chaotic"] * 22, rising + [30.0] * 22)
    assert smooth_end(THESIS_IMPACT_BEAM, comparison, breaks).value == 8.0


def test_chaos_begins_at_the_first_response_that_is_not_periodic():
    """From 16 Hz on, with a periodic window at 19 Hz."""
    comparison = COMPARED["IBS-023"]
    natures = ["periodic"] * 15 + ["chaotic"] * 3 + ["periodic"] + ["chaotic"] * 11
    found = RESPONSE_QUANTITIES["chaos_begin"].finding(THESIS_IMPACT_BEAM, comparison, curve(natures, [40.0] * 30))
    assert found.value == 16.0
    none = RESPONSE_QUANTITIES["chaos_begin"].finding(
        THESIS_IMPACT_BEAM, comparison, curve(["periodic"] * 30, [40.0] * 30)
    )
    assert none.value == 31.0


@pytest.mark.parametrize("nature", ["undetermined", "failed", "quasiperiodic"])
def test_what_is_not_known_to_be_chaotic_agrees_with_no_chaos(nature):
    """A response without a verdict meets neither "chaotic" nor "periodic", ends no range and begins none."""
    one, curve_of_30 = curve([nature], [40.0]), curve(["periodic"] * 15 + [nature] + ["chaotic"] * 14, [40.0] * 30)
    found = {
        name: RESPONSE_QUANTITIES[COMPARED[name].quantity].finding(THESIS_IMPACT_BEAM, COMPARED[name], results)
        for name, results in {
            "IBS-013": one,
            "IBS-014": one,
            "IBS-028": one,
            "IBS-043": one,
            "IBS-074": one,
            "IBS-075": one,
            "SSC-056": one,
            "SSC-065": [*curve(["chaotic"], [40.0]), *one],
            "IBS-021": curve_of_30,
            "IBS-023": curve_of_30,
            "SSC-066": curve(["periodic"] * 10 + [nature], [40.0] * 11),
            "SSC-067": curve(["periodic"] * 20 + [nature], [40.0] * 21),
            "SSC-042": curve([nature] * 11, [40.0] * 11),
            "IBS-031": curve((["periodic"] * 16 + [nature] + ["chaotic"] * 13) * 4, [40.0] * 120),
        }.items()
    }
    assert [name for name, finding in found.items() if finding.agrees] == []


def test_modes_driven_by_the_recorded_force_follow_the_tip():
    """The motion of the force point is rebuilt from the contact force; the rebuilt tip lies within 1 % of the gap."""
    found = force_point_motion(THESIS_IMPACT_BEAM, 20)
    assert found["tip_error"] < 0.01 * THESIS_IMPACT_BEAM.clearance
    assert found["velocity"][1] == pytest.approx(-found["velocity"][0], rel=0.3)


def test_a_long_run_tells_how_long_it_was_irregular():
    """At 30 Hz and +-0.127 mm the chaos of the thesis lasts; at 4 Hz the motion repeats after a few cycles."""
    chaotic = long_run(replace(THESIS_IMPACT_BEAM, excitation_frequency=30.0, clearance=0.127e-3), 400)
    assert chaotic == {"irregular_cycles": 400, "period": None, "nature": "chaotic"}
    settled = long_run(replace(THESIS_IMPACT_BEAM, excitation_frequency=4.0, clearance=0.03175e-3), 200)
    assert settled["period"] == 1
    assert settled["irregular_cycles"] < 50


@pytest.mark.parametrize(
    ("run", "verdict"),
    [
        ({"irregular_cycles": 4000, "period": None, "nature": "chaotic"}, "hit"),
        ({"irregular_cycles": 3999, "period": 4, "nature": "chaotic"}, "miss"),
        ({"irregular_cycles": 4000, "period": None, "nature": "undetermined"}, "miss"),
    ],
)
def test_chaos_up_to_the_end_of_the_run_leaves_out_no_cycle(run, verdict):
    """Chaos "up to 4000 cycles" (5.2.3) is met by all 4000 of them, and by chaos alone."""
    one = COMPARED["IBS-071"]
    assert judge(one, [QUANTITIES[one.quantity].finding(THESIS_IMPACT_BEAM, one, [run])]).verdict == verdict


def test_angles_are_those_of_the_revolutions_that_lose_contact():
    """Of three revolutions one keeps contact: the median gap is that of the others; without any there is none."""
    force = np.ones((3, 360))
    force[0, 70:90] = force[1, 80:100] = 0.0
    found = median_angles(force)
    assert (found["loss"], found["resumption"]) == (75.0, 95.0)
    assert median_angles(force[2:])["loss"] is None


def test_crank_clearance_unit_is_the_thrust_of_the_slider():
    """r m / M: the whole crank radius for a slider without a yoke (thesis 4.5.1)."""
    alone = replace(THESIS_SLIDER_CRANK, yoke_mass=0.0, yoke_inertia=1e-3, yoke_offset_along=0.0)
    assert clearance_unit(alone) == pytest.approx(alone.crank_radius)
    assert clearance_unit(THESIS_SLIDER_CRANK) < alone.crank_radius


def test_results_are_kept_and_found_again(tmp_path, monkeypatch):
    """The second call runs nothing and gives the same result; another machine or an edited source does."""
    job = Job(observation, THESIS_IMPACT_BEAM, QUICK["impact-beam"])
    first = run_jobs([job, job], folder=tmp_path)
    assert len(first) == 1
    kept = list(tmp_path.glob("*.json"))
    assert len(kept) == 1
    kept[0].write_text(json.dumps({**first[job], "mean": -1.0}))
    assert run_jobs([job], folder=tmp_path)[job]["mean"] == -1.0
    monkeypatch.setattr("thesis.cache.SOURCES", "edited")
    assert run_jobs([job], folder=tmp_path)[job]["mean"] == first[job]["mean"]
    assert len(list(tmp_path.glob("*.json"))) == 2
    kept[0].write_text("{")
    monkeypatch.undo()
    assert run_jobs([job], folder=tmp_path)[job] == first[job]


def test_same_machine_same_bytes():
    """Two runs of one job give the same result."""
    one, other = (observe(THESIS_IMPACT_BEAM, Effort(20, 30, 0)) for _ in range(2))
    assert one == other
    assert np.isfinite(one.mean)
