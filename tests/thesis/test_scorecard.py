"""The scorecard runs what the thesis ran, and runs it once."""

import json
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.machines.slider_crank.equations import equations
from chaosgym.series import two_step_test
from chaosgym.simulation import simulate
from tests.plain_modes import HARD_BEAM, PLAIN_BEAM, PLAIN_CRANK
from thesis.scorecard.beam_runs import bouncing_shares, force_point_motion, long_run
from thesis.scorecard.crank_runs import median_angles
from thesis.scorecard.evaluation import evaluate
from thesis.scorecard.jobs import Job, observation, run_jobs
from thesis.scorecard.observation import QUICK, READING_ERROR, THOROUGH, Effort, Observation, observe, plotted_peaks
from thesis.scorecard.quantities import QUANTITIES, clearance_unit, lateral_mass
from thesis.scorecard.response_quantities import RESPONSE_QUANTITIES
from thesis.scorecard.verdicts import judge
from thesis.statements import conditions, read_comparisons

COMPARED = {one.id: one for one in read_comparisons().compared}


def curve(natures, forces):
    """Results of observation jobs along an axis."""
    return [
        Observation(nature=nature, low=force, mean=force, high=force).as_dict()
        for nature, force in zip(natures, forces, strict=True)
    ]


def test_beam_scales_and_natures_are_those_of_the_thesis():
    """Chaos at 30 Hz, the dimensionless clearance of 0.127 mm, the frequency at 284.0 mm: hit by the thesis' beam."""
    wanted = [COMPARED[name] for name in ("IBS-014", "IBS-017", "IBS-034")]
    judged = evaluate(wanted, {"impact-beam": PLAIN_BEAM}, efforts=THOROUGH)
    assert [one.verdict for one in judged] == ["hit", "hit", "hit"]


def test_dots_closer_than_the_width_of_a_dot_are_one():
    """A spread below 1 N reads as periodic from a figure; without the reading error the same run is judged exactly."""
    seen = observe(replace(PLAIN_BEAM, excitation_frequency=30.0, clearance=0.127e-3), Effort(100, 60, 0))
    assert not seen.is_periodic
    assert seen.low < seen.mean < seen.high
    quiet = observe(replace(PLAIN_BEAM, excitation_frequency=6.0, clearance=0.03175e-3), Effort(60, 60, 0))
    assert quiet.is_periodic
    assert quiet.high - quiet.low < 1.0


def test_dots_are_the_series_that_the_thesis_plots():
    """One side of the beam's bearing, the resultant of the crank's joint: by them nature and forces are read.

    At 20 Hz and +-0.032 mm the beam's upper side repeats within a dot and the lower one does not. At 100 rpm and 2.5 %
    contact damping the crank's forces are read from the larger of both sides, which is not always the upper one.
    """
    beam = replace(PLAIN_BEAM, excitation_frequency=20.0, clearance=0.03175e-3)
    record = simulate(beam, 300).after(200)
    assert np.array_equal(plotted_peaks(record), record.peak_force[:, 0])
    assert two_step_test(record, sensor_error=READING_ERROR).nature != "periodic"
    assert observe(beam, THOROUGH["impact-beam"]).nature == "periodic"
    crank = replace(PLAIN_CRANK, crank_speed=100.0, slider_clearance=0.03175e-3, contact_damping_ratio=0.025)
    record = simulate(crank, 110).after(60)
    assert np.array_equal(plotted_peaks(record), record.peak_force.max(axis=1))
    seen = observe(crank, THOROUGH["slider-crank"])
    assert seen.low == record.peak_force.max(axis=1).min()
    longer = simulate(crank, 2000)
    assert np.any(longer.peak_force[:, 1] > longer.peak_force[:, 0])


def test_either_of_two_mirrored_sides_is_what_the_thesis_plots():
    """Printed is 70 N, periodic, at 29 Hz (IBS-028); with a hard pivot one side shows 69.2 N, the other 75.4 N, and a
    last digit decides which is the upper one. Whichever it is, the nearer side counts, in thorough and in hasty runs; a
    crank has one resultant."""
    modes = {"reduction": "interfaces", "n_modes": 5, "fitted_modes": 0}
    beam = replace(HARD_BEAM, **modes, excitation_frequency=29.0, clearance=0.127e-3)
    one = COMPARED["IBS-028"]
    for effort in (THOROUGH["impact-beam"]._replace(budget=0), QUICK["impact-beam"]):
        seen = observe(beam, effort)
        assert sorted(side.mean for side in seen.sides) == pytest.approx([69.24, 75.43], abs=0.05)
        swapped = replace(seen.other, other=replace(seen, other=None))
        found = [
            QUANTITIES[one.quantity].finding(beam, one, [json.loads(json.dumps(side.as_dict()))])
            for side in (seen, swapped)
        ]
        assert found[0] == found[1]
        assert found[0].value == pytest.approx(69.24, abs=0.05)
    assert observe(PLAIN_CRANK, QUICK["slider-crank"]).other is None


def test_the_length_of_a_chaotic_transient_is_that_of_many():
    """From rest IBS-068 was 100 cycles on one processor and 29 on another; of nine initial states the median counts.
    The longest of the runs that become periodic is it; one that stays irregular has no end to count."""
    quantity, one = QUANTITIES["irregular_settling"], COMPARED["IBS-068"]
    jobs = quantity.jobs(PLAIN_BEAM, one, THOROUGH["impact-beam"])
    count = len(one.along.values) * len(one.across.values)
    assert len(set(jobs)) == 9 * count
    lengths = [29, 302, 76, 450, 91, 29, 244, 106, 274]
    results = [
        {"irregular_cycles": 500 if k else length, "period": None if k else 1}
        for length in lengths
        for k in range(count)
    ]
    assert quantity.finding(PLAIN_BEAM, one, results).value == 106.0
    never = [{"irregular_cycles": 500, "period": None}] * len(results)
    assert quantity.finding(PLAIN_BEAM, one, never).value is None


def test_a_hasty_run_reads_what_a_long_one_does():
    """Where a response settles soon it ends early, with the same force; chaos stays chaos, from any initial state."""
    calm = replace(PLAIN_BEAM, excitation_frequency=6.0, clearance=0.03175e-3)
    long, hasty = observe(calm, THOROUGH["impact-beam"]._replace(budget=0)), observe(calm, QUICK["impact-beam"])
    assert (hasty.nature, hasty.period, hasty.settle_cycle) == ("periodic", 1, long.settle_cycle)
    assert hasty.mean == pytest.approx(long.mean, abs=0.02)
    for start in (0, 3):
        assert observe(PLAIN_BEAM, QUICK["impact-beam"]._replace(start=start)).nature == "chaotic"
    assert observe(calm, QUICK["impact-beam"]._replace(start=3)).mean == pytest.approx(long.mean, abs=0.02)


def test_dots_that_spread_beyond_the_reading_error_are_chaos():
    """At 170 rpm and 2.5 % the 50 dots spread over 3 N: the nature is told from them, as the thesis told it.

    Rounding decides by how much, and may settle one of a dozen runs; so the middle of five initial states counts.
    """
    crank = replace(PLAIN_CRANK, crank_speed=170.0, slider_clearance=0.03175e-3, contact_damping_ratio=0.025)
    runs = [observe(crank, THOROUGH["slider-crank"]._replace(start=start)) for start in range(5)]
    seen = sorted(runs, key=lambda run: run.high - run.low)[2]
    assert (seen.nature, seen.period, seen.settle_cycle) == ("chaotic", None, None)
    assert seen.high - seen.low > 3.0


def test_type_one_ends_where_the_force_first_falls():
    """Forces that rise to 8 Hz and fall at 9 end Type I at 8 Hz; so does a response that is not periodic."""
    comparison = COMPARED["IBS-020"]
    rising = [10.0 + n for n in range(8)]
    natures = ["periodic"] * 30
    smooth_end = RESPONSE_QUANTITIES["smooth_end"].finding
    falls = curve(natures, rising + [16.0] * 22)
    assert smooth_end(PLAIN_BEAM, comparison, falls).value == 8.0
    breaks = curve(natures[:8] + ["chaotic"] * 22, rising + [30.0] * 22)
    assert smooth_end(PLAIN_BEAM, comparison, breaks).value == 8.0


def test_chaos_begins_at_the_first_response_that_is_not_periodic():
    """From 16 Hz on, with a periodic window at 19 Hz."""
    comparison = COMPARED["IBS-023"]
    natures = ["periodic"] * 15 + ["chaotic"] * 3 + ["periodic"] + ["chaotic"] * 11
    found = RESPONSE_QUANTITIES["chaos_begin"].finding(PLAIN_BEAM, comparison, curve(natures, [40.0] * 30))
    assert found.value == 16.0
    none = RESPONSE_QUANTITIES["chaos_begin"].finding(PLAIN_BEAM, comparison, curve(["periodic"] * 30, [40.0] * 30))
    assert none.value == 31.0


@pytest.mark.parametrize("nature", ["undetermined", "failed", "quasiperiodic"])
def test_what_is_not_known_to_be_chaotic_agrees_with_no_chaos(nature):
    """A response without a nature meets neither "chaotic" nor "periodic", ends no range and begins none."""
    one, curve_of_30 = curve([nature], [40.0]), curve(["periodic"] * 15 + [nature] + ["chaotic"] * 14, [40.0] * 30)
    found = {
        name: RESPONSE_QUANTITIES[COMPARED[name].quantity].finding(PLAIN_BEAM, COMPARED[name], results)
        for name, results in {
            "IBS-013": one,
            "IBS-014": one,
            "IBS-028": one,
            "IBS-043": one,
            "IBS-074": one,
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
    found = force_point_motion(PLAIN_BEAM, 20, 20)
    assert found["tip_error"] < 0.01 * PLAIN_BEAM.clearance
    assert found["velocity"][1] == pytest.approx(-found["velocity"][0], rel=0.3)


def test_a_long_run_tells_how_long_it_was_irregular():
    """At 30 Hz and +-0.127 mm the chaos of the thesis lasts; at 4 Hz the motion repeats after a few cycles."""
    chaotic = long_run(replace(PLAIN_BEAM, excitation_frequency=30.0, clearance=0.127e-3), 400)
    assert chaotic == {"irregular_cycles": 400, "period": None, "nature": "chaotic"}
    settled = long_run(replace(PLAIN_BEAM, excitation_frequency=4.0, clearance=0.03175e-3), 200)
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
    assert judge(one, [QUANTITIES[one.quantity].finding(PLAIN_BEAM, one, [run])]).verdict == verdict


def test_angles_are_those_of_the_revolutions_that_lose_contact():
    """Of three revolutions one keeps contact: the median gap is that of the others; without any there is none."""
    force = np.ones((3, 360))
    force[0, 70:90] = force[1, 80:100] = 0.0
    found = median_angles(force)
    assert (found["loss"], found["resumption"]) == (75.0, 95.0)
    assert median_angles(force[2:])["loss"] is None


def test_crank_clearance_unit_is_the_thrust_of_the_slider():
    """r m / M: the whole crank radius for a slider on a rod without mass or end inertias (thesis 4.5.1)."""
    bare = dict.fromkeys(("yoke_mass", "yoke_inertia", "yoke_offset_along", "housing_inertia", "housing_mass"), 0.0)
    alone = replace(PLAIN_CRANK, **bare, density=10.0)
    assert clearance_unit(alone) == pytest.approx(alone.crank_radius, rel=1e-3)
    assert clearance_unit(PLAIN_CRANK) < 0.6 * alone.crank_radius


def test_what_swings_about_the_ball_centre_goes_with_the_slider():
    """The lateral mass is the kinetic energy at a speed of 1 m/s of the slider, twice, of all that moves with it."""
    crank = PLAIN_CRANK
    at_rest = equations(replace(crank, rod="rigid"), np.zeros(1))
    assert lateral_mass(crank) == pytest.approx(at_rest.mass[0, 0, 0], rel=1e-3)


def test_a_flight_that_is_open_at_zero_degrees_is_no_gap_of_the_half_revolution():
    """Of a flight from 350 to 20 deg and one from 55 to 75 deg, the shorter one begins in the half revolution."""
    force = np.ones((1, 360))
    force[0, 350:] = force[0, :20] = force[0, 55:75] = 0.0
    force[0, 78] = 5.0
    found = median_angles(force)
    assert (found["loss"], found["resumption"], found["impact"]) == (55.0, 75.0, 78.0)


def test_bouncing_counts_from_the_first_touch_to_the_last_release():
    """Two bounces and a long contact: bouncing is a third of the stay; without the long contact nearly all of it."""
    stay = [0, 1, 0, 1, 0, 1, 1, 1, 1, 1, 1, 1, 1]
    bounced = [0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0]
    other = [0, -1, -1, -1, -1, 0]
    force = np.array([*other, *stay, *other, *bounced, *other], dtype=float)
    assert bouncing_shares(force) == pytest.approx([4 / 12, 0.0, 10 / 11])


def test_impacts_only_within_a_range_need_not_fill_it():
    """ "Only in 100-200 rpm" is met by impacts at 110 to 150 rpm, near at 220 and missed at 230 or without any."""
    one = COMPARED["SSC-033"]
    speeds, rows = one.along.values, len(one.across.values)

    def verdict(*lost):
        results = [{"lost": float(speed in lost)} for _ in range(rows) for speed in speeds]
        return judge(one, [QUANTITIES[one.quantity].finding(PLAIN_CRANK, one, results)]).verdict

    assert verdict(110.0, 120.0, 150.0) == verdict(200.0, 210.0) == "hit"
    assert (verdict(90.0, 220.0), verdict(230.0), verdict()) == ("near", "miss", "miss")


def test_the_trend_of_chaos_leaves_out_periodic_windows():
    """Spreads of 30, 20 and 10 N fall steadily, whatever periodic responses lie between them."""
    one = COMPARED["IBS-045"]
    count = len(one.along.values)
    results = [Observation("periodic", 1, low=50.0, mean=50.0, high=50.0).as_dict() for _ in range(count)]
    for place, spread in ((0, 30.0), (9, 20.0), (20, 10.0)):
        results[place] = Observation("chaotic", low=40.0, mean=45.0, high=40.0 + spread).as_dict()
    assert QUANTITIES[one.quantity].finding(PLAIN_BEAM, one, results).value == pytest.approx(-1.0)


def test_a_nature_is_told_from_the_dots_and_the_diagnosis_stands_beside_it():
    """Dots that spread over the reading error are chaos to a reader; the note says what the diagnosis calls them."""
    seen = Observation("chaotic", None, "quasiperiodic", 2.0, 30.0, 33.0, 36.0)
    one = COMPARED["IBS-014"]
    found = QUANTITIES[one.quantity].finding(PLAIN_BEAM, one, [seen.as_dict()])
    assert found.agrees
    assert "diagnosis: quasiperiodic" in found.note


def test_one_damping_ratio_holds_for_the_whole_of_section_4_4():
    """Its value is not in print; every statement of figures 4.11 to 4.13 takes the same one, those of 4.5 never."""
    for name, one in COMPARED.items():
        if name.startswith("SSC"):
            open_ones = [at.get("contact_damping_ratio") for at in one.at]
            assert all(isinstance(v, dict) for v in open_ones) == (one.statement.section == "4.4.2"), name
    at = COMPARED["SSC-040"].at[0]
    assert conditions(at, {"damping_of_section_4_4": 0.015})["contact_damping_ratio"] == 0.015


def test_results_are_kept_and_found_again(tmp_path, monkeypatch):
    """The second call runs nothing and gives the same result; another machine, source or computer does."""
    job = Job(observation, PLAIN_BEAM, QUICK["impact-beam"])
    first = run_jobs([job, job], folder=tmp_path)
    assert len(first) == 1
    kept = list(tmp_path.glob("*.json"))
    assert len(kept) == 1
    kept[0].write_text(json.dumps({**first[job], "mean": -1.0}))
    assert run_jobs([job], folder=tmp_path)[job]["mean"] == -1.0
    monkeypatch.setattr("thesis.cache.SOURCES", "edited")
    assert run_jobs([job], folder=tmp_path)[job]["mean"] == first[job]["mean"]
    assert len(list(tmp_path.glob("*.json"))) == 2
    monkeypatch.undo()
    monkeypatch.setattr("thesis.cache.computer", lambda: "another one")
    assert run_jobs([job], folder=tmp_path)[job]["mean"] == first[job]["mean"]
    assert len(list(tmp_path.glob("*.json"))) == 3
    kept[0].write_text("{")
    monkeypatch.undo()
    assert run_jobs([job], folder=tmp_path)[job] == first[job]


def test_same_machine_same_bytes():
    """Two runs of one job give the same result."""
    one, other = (observe(PLAIN_BEAM, Effort(20, 30, 0)) for _ in range(2))
    assert one == other
    assert np.isfinite(one.mean)
