import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chaosgym.errors import DiagnosisError
from chaosgym.machines.impact_beam import ImpactBeam
from chaosgym.series import Diagnosis, two_step_test
from chaosgym.simulation import CycleRecord, MotionState, simulate
from tests.series.maps import GOLDEN, circle, henon, logistic, three_frequencies


@pytest.mark.parametrize(
    ("r", "period"), [(2.5, 1), (3.2, 2), (3.5, 4), (3.55, 8), (3.567, 16), (3.83, 3), (3.845, 6), (3.74, 5)]
)
def test_windows_of_the_logistic_map_have_their_period(r, period):
    """Period doubling 1, 2, 4, 8, 16 and the windows of period 3, 6 and 5 of the logistic map."""
    verdict = two_step_test(logistic(r, 200))
    assert (verdict.nature, verdict.period, verdict.transient_chaos) == ("periodic", period, 0)
    assert verdict.margin > 0.5


@pytest.mark.parametrize(("r", "bands"), [(4.0, 1), (3.9, 1), (3.6, 2), (3.5748, 8), (3.5709, 16)])
def test_banded_chaos_is_chaos(r, bands):
    """Chaos of the logistic map in 1, 2, 8 and 16 bands, the narrowest one a hundredth of the range wide."""
    verdict = two_step_test(logistic(r, 1000))
    assert (verdict.nature, verdict.period) == ("chaotic", None)
    assert verdict.evidence["bands"] == bands


@pytest.mark.parametrize("series", [henon(400), logistic(3.8282, 400), circle(2.5, 0.6, 400)])
def test_fractal_intermittent_and_broken_torus_chaos(series):
    """Henon's attractor, type I intermittency below the period-3 window, and the circle map past its critical point."""
    assert two_step_test(series).nature == "chaotic"


@pytest.mark.parametrize(
    "series",
    [circle(0.3, GOLDEN, 1000), circle(0.9, 0.6069, 1000), circle(0.99, 0.60667, 1000), three_frequencies(1000)],
)
def test_tori_are_quasiperiodic_and_only_long_records_say_so(series):
    """Invariant circles up to near criticality and a three-frequency torus; 100 cycles of them are never chaotic."""
    assert two_step_test(series).nature == "quasiperiodic"
    assert two_step_test(series[:100]).nature == "undetermined"


@pytest.mark.parametrize(
    ("series", "error", "least"),
    [
        (logistic(4.0, 1000), 0.0, "diffuses"),
        (logistic(3.6, 1000), 0.0, "diffuses"),
        (logistic(3.8, 100)[:60], 0.0, "broad"),
        (50.0 + 30.0 * logistic(4.0, 300), 1.0, "misfit"),
    ],
)
def test_the_margin_of_chaos_is_its_weakest_proof(series, error, least):
    """Spectral floor, growth of the 0-1 walk and misfit each keep a distance from a threshold; the least one counts."""
    verdict = two_step_test(series, sensor_error=error)
    assert verdict.nature == "chaotic"
    evidence = verdict.evidence
    threshold = 1e-2 if len(series) >= 200 else 1e-1
    distances = {
        "broad": min(1.0, np.log10(evidence["spectral_floor"] / threshold)),
        "diffuses": 1.0 if evidence["zero_one"] is None else (evidence["zero_one"] - 0.5) / 0.5,
        "misfit": min(1.0, np.log10(evidence["residual"] / evidence["residual_allowed"]) / 2.0),
    }
    assert min(distances, key=distances.get) == least
    assert verdict.margin == pytest.approx(distances[least], rel=1e-12)
    assert 0.0 < verdict.margin < 1.0


NOISE = np.random.default_rng(2).normal(size=1000)


@pytest.mark.parametrize(
    ("series", "decided"),
    [
        (circle(0.99, 0.60667, 1000), "slack"),
        (circle(0.9, 0.6069, 1000), "slack"),
        (circle(0.3, GOLDEN, 1000) + 0.004 * NOISE, "floor"),
    ],
)
def test_the_margin_of_a_torus_is_its_weakest_proof(series, decided):
    """The 0-1 walk must stay below 0.2 and the floor below 1e-3; undetermined verdicts have no margin."""
    verdict = two_step_test(series)
    evidence = verdict.evidence
    distances = {
        "slack": (0.2 - evidence["zero_one"]) / 0.2,
        "floor": min(1.0, np.log10(1e-3 / evidence["spectral_floor"])),
    }
    assert min(distances, key=distances.get) == decided
    assert verdict.margin == pytest.approx(distances[decided], rel=1e-12)
    assert two_step_test(circle(0.3, GOLDEN, 1000)).margin == 1.0, "never above 1"
    for unsure in (two_step_test(circle(0.3, GOLDEN, 100)), two_step_test(logistic(3.0, 1000))):
        assert (unsure.nature, unsure.margin) == ("undetermined", 0.0)


def test_the_margin_of_a_period_counts_decades_to_what_is_allowed():
    """A misfit of a tenth of what is allowed is one decade of two; none at all is 1."""
    verdict = two_step_test(logistic(3.2, 200))
    misfit, allowed = verdict.evidence["residual"], verdict.evidence["residual_allowed"]
    assert verdict.margin == pytest.approx(min(1.0, np.log10(allowed / max(misfit, 1e-300)) / 2.0))
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, 300)
    rough = two_step_test(np.tile([50.0, 57.0, 66.0], 100) + noise, sensor_error=3.0)
    distance = np.log10(rough.evidence["residual_allowed"] / rough.evidence["residual"]) / 2.0
    assert 0.0 < distance < 1.0
    assert rough.margin == pytest.approx(distance, rel=1e-12)


def test_a_locked_circle_map_is_periodic():
    """In the middle of the Arnold tongue of 1/2 the circle map repeats every two cycles."""
    verdict = two_step_test(circle(0.95, 0.5, 200))
    assert (verdict.nature, verdict.period) == ("periodic", 2)


@pytest.mark.parametrize(("r", "period"), [(2.99, 1), (3.0 + 1e-2, 2), (3.44, 2)])
def test_slow_decay_is_periodic(r, period):
    """Near a period doubling the motion settles over hundreds of cycles, but is periodic."""
    verdict = two_step_test(logistic(r, 400, skip=20))
    assert (verdict.nature, verdict.period) == ("periodic", period)


def test_chaos_that_happens_to_fall_is_not_a_slow_decay():
    """Distances that fall from block to block by chance and then drop are no approach to a period."""
    chaos = logistic(3.9, 1600) * np.repeat([1.0, 0.98, 0.96, 0.94, 0.92, 0.9, 0.88, 0.2], 200)
    assert two_step_test(chaos).nature != "periodic"


def test_at_the_bifurcation_itself_nothing_is_claimed():
    """At r = 3 deviations fall like n^-1/2: neither a torus nor a period."""
    verdict = two_step_test(logistic(3.0, 1000))
    assert verdict.nature == "undetermined"
    assert "shrinks" in verdict.reason


def test_transient_chaos_is_counted():
    """Chaos that gives way to period 3 is transient chaos; an irregular start of 20 cycles is not (thesis 5.2.3)."""
    chaos, settled = logistic(4.0, 300), logistic(3.83, 600)
    verdict = two_step_test(np.concatenate([chaos, settled]))
    assert (verdict.nature, verdict.period) == ("periodic", 3)
    assert verdict.transient_chaos == pytest.approx(300, abs=3)
    assert verdict.labelled("thesis").nature == "chaotic"
    assert verdict.settle_cycle == pytest.approx(300, abs=3)
    ordinary = two_step_test(np.concatenate([chaos[:20], settled]))
    assert (ordinary.nature, ordinary.transient_chaos) == ("periodic", 0)
    assert ordinary.labelled("thesis").nature == "periodic"


@pytest.mark.parametrize("seed", range(5))
def test_noise_within_the_stated_error_does_not_hide_a_period(seed):
    """Peaks 50, 57, 66 N with errors up to 3 N repeat every three cycles; without the statement nothing repeats."""
    rng = np.random.default_rng(seed)
    peaks = np.tile([50.0, 57.0, 66.0], 100)
    for noise in (rng.uniform(-3.0, 3.0, 300), rng.normal(size=300)):
        verdict = two_step_test(peaks + noise, sensor_error=3.0)
        assert (verdict.nature, verdict.period) == ("periodic", 3)
        assert two_step_test(peaks + noise).nature != "periodic"


@pytest.mark.parametrize("error", [0.3, 30.0])
def test_a_period_is_seen_through_any_length_of_noise(error):
    """Half ranges of normal noise grow beyond three deviations; its scatter does not."""
    peaks = error * (np.tile([50.0, 57.0, 66.0], 3000) + np.random.default_rng(0).normal(size=9000) / 3.0)
    verdict = two_step_test(peaks, sensor_error=error)
    assert (verdict.nature, verdict.period) == ("periodic", 3)


@pytest.mark.parametrize("unit", [1.0, 1e7])
def test_what_needs_exact_values_is_not_asked_of_a_sensor(unit):
    """Noise walks as chaos does and hides slow decays: neither transient chaos nor an approach is claimed."""
    transient = unit * np.concatenate([logistic(4.0, 300), logistic(3.83, 600)])
    assert two_step_test(transient).transient_chaos
    assert not two_step_test(transient, sensor_error=1e-6 * unit).transient_chaos
    slow = unit * (50.0 + 0.99 ** np.arange(400))
    assert two_step_test(slow).nature == "periodic"
    assert not two_step_test(slow, sensor_error=1e-6 * unit).reason.startswith("approaches")


def test_chaos_shows_through_noise_and_a_noisy_torus_is_not_called_chaotic():
    """30 N of logistic chaos exceeds 3 N of sensor error; one line with noise has no band beyond that noise."""
    noise = np.random.default_rng(1).uniform(-3.0, 3.0, 1000)
    assert two_step_test(50.0 + 30.0 * logistic(4.0, 1000) + noise, sensor_error=3.0).nature == "chaotic"
    torus = 50.0 + 30.0 * np.cos(2.0 * np.pi * GOLDEN * np.arange(1000))
    assert two_step_test(torus + noise, sensor_error=3.0).nature in ("quasiperiodic", "undetermined")


def _undetermined(evidence, reason):
    """A verdict that claims nothing."""
    given = {"horizon": evidence["cycles"], "evidence": evidence, "reason": reason}
    return Diagnosis(nature="undetermined", period=None, margin=0.0, **given)


REPETITION = {"cycles", "residual", "residual_allowed"}
STEP_ONE = REPETITION | {"contraction_per_cycle"}
STEP_TWO = REPETITION | {"zero_one", "spectral_floor", "spectral_lines", "bands", "section"}
FIGURES = "spectral floor {spectral_floor:.1e}, 0-1 statistic {zero_one:.2f}"


@pytest.mark.parametrize(
    ("series", "evidence", "reason"),
    [
        (
            logistic(4.0, 49),
            STEP_TWO,
            "does not repeat, but 49 cycles are too few to tell chaos from a torus",
        ),
        (
            circle(0.3, GOLDEN, 999),
            STEP_TWO,
            "does not repeat and has {spectral_lines} spectral lines, but 999 cycles are fewer than the 1000 that "
            "quasiperiodic asks for",
        ),
        (
            circle(0.3, GOLDEN, 1000) + 0.02 * NOISE,
            STEP_TWO,
            f"does not repeat, and step II does not decide: {FIGURES}",
        ),
        (
            1.0 + 1.0 / np.sqrt(np.arange(400.0, 800.0)),
            STEP_ONE,
            "shrinks steadily, but only 2.5 times over the record: too slowly to tell what it ends in",
        ),
    ],
)
def test_what_is_undetermined_says_why(series, evidence, reason):
    """Too short for chaos, too short for a torus, neither few lines nor a band, or a decay that is too slow."""
    verdict = two_step_test(series)
    assert verdict == _undetermined(verdict.evidence, reason.format(**verdict.evidence))
    assert set(verdict.evidence) == evidence
    assert verdict.evidence["cycles"] == len(series)


@pytest.mark.parametrize(
    ("series", "nature", "reason"),
    [
        (logistic(4.0, 50), "chaotic", f"does not repeat, broad spectrum: {FIGURES}"),
        (logistic(4.0, 1000), "chaotic", f"does not repeat, broad spectrum: {FIGURES}"),
        (logistic(3.6, 1000), "chaotic", f"does not repeat, in 2 bands, broad spectrum: {FIGURES}"),
        (
            circle(0.3, GOLDEN, 1000),
            "quasiperiodic",
            f"does not repeat, {{spectral_lines}} spectral lines and no band: {FIGURES}",
        ),
    ],
)
def test_what_does_not_repeat_says_what_it_rests_on(series, nature, reason):
    """Bands, lines, the floor between them and the growth of the walks."""
    verdict = two_step_test(series)
    assert (verdict.nature, verdict.reason) == (nature, reason.format(**verdict.evidence))
    assert set(verdict.evidence) == STEP_TWO


@pytest.mark.parametrize(("period", "words"), [(1, "cycle"), (2, "2 cycles")])
def test_what_repeats_says_how_well(period, words):
    """A misfit of 2e-6 of the largest value, allowed 1e-5; before, distances shrank by 0.9 a cycle."""
    n = np.arange(400)
    series = 50.0 + (n % period) + 10.0 * 0.9**n + 2e-6 * 51.0 * np.sin(n)
    verdict = two_step_test(series)
    assert (verdict.nature, verdict.period) == ("periodic", period)
    assert verdict.reason == f"repeats every {words} within {verdict.evidence['residual']:.1e}"
    assert verdict.evidence["contraction_per_cycle"] == pytest.approx(0.9, abs=0.02)
    assert set(verdict.evidence) == STEP_ONE | {"irregular_cycles"}
    assert verdict.evidence["irregular_cycles"] == 0


def test_a_slow_approach_says_how_fast():
    """Distances that shrink by 1 % a cycle, of a motion whose every second cycle is another."""
    n = np.arange(400)
    verdict = two_step_test(50.0 + n % 2 + 0.99**n)
    assert (verdict.nature, verdict.period, verdict.margin, verdict.horizon) == ("periodic", 2, 0.0, 400)
    assert verdict.reason == "approaches period 2 by a factor 0.99 a cycle"
    assert set(verdict.evidence) == STEP_ONE | {"irregular_cycles"}
    assert verdict.evidence["contraction_per_cycle"] == pytest.approx(0.99, rel=1e-6)


def test_lines_of_short_records_overlap():
    """A weak band counts from 200 cycles on; shorter records need a stronger one."""
    assert two_step_test(logistic(3.85, 200)).nature == "chaotic"
    assert two_step_test(logistic(3.85, 199)).nature == "undetermined"


def test_step_two_can_be_left_out():
    """What repeats is said; the rest is left open."""
    verdict = two_step_test(logistic(4.0, 200), repeats_only=True)
    assert verdict == _undetermined(verdict.evidence, "does not repeat")
    assert set(verdict.evidence) == REPETITION
    assert two_step_test(logistic(3.2, 200), repeats_only=True) == two_step_test(logistic(3.2, 200))


@pytest.mark.parametrize(("spread", "seen"), [(1.8, False), (2.2, True)])
def test_a_band_is_more_than_twice_the_stated_noise(spread, seen):
    """Errors spread evenly over +-e have the power e^2 / 3; up to twice that of the stated error is no band."""
    turns = 2.0 * np.pi * GOLDEN * np.arange(4000)
    noise = np.random.default_rng(2).uniform(-1.0, 1.0, 4000)
    for stated in (0.2, 3.0):
        series = 50.0 + 10.0 * stated * np.cos(turns) + np.sqrt(spread) * stated * noise
        floor = two_step_test(series, sensor_error=stated).evidence["spectral_floor"]
        assert (floor > 0.0) == seen


def test_lines_hold_all_the_power_but_the_noise():
    """One line and noise of the stated size; if less is stated, the noise counts as lines of its own."""
    noise = np.random.default_rng(2).uniform(-1.0, 1.0, 4000)
    series = 100.0 + 10.0 * np.cos(2.0 * np.pi * GOLDEN * np.arange(4000)) + 2.0 * noise
    lines = [two_step_test(series, sensor_error=error).evidence["spectral_lines"] for error in (1.0, 1.6, 2.0, 2.5)]
    assert lines[0] > lines[1] > 16
    assert lines[2:] == [1, 1]


@pytest.mark.parametrize(("share", "drowned"), [(0.49, False), (0.51, True)])
def test_noise_that_walks_as_far_as_the_motion_drowns_the_0_1_test(share, drowned):
    """Walks of n cycles with the stated noise go n e^2 / 3: no more than half the variance of the motion."""
    series = 50.0 + np.cos(2.0 * np.pi * GOLDEN * np.arange(1000))
    verdict = two_step_test(series, sensor_error=np.sqrt(3.0 * share * 0.5 / 1000))
    assert (verdict.evidence["zero_one"] is None) == drowned
    assert (", 0-1 test drowned by noise" in verdict.reason) == drowned


@pytest.mark.parametrize(("cycles", "longest"), [(17, 1), (60, 3), (1022, 63), (1023, None)])
def test_noise_needs_long_records_and_the_verdict_says_so(cycles, longest):
    """A period must be seen eight times in the second half; the hint is there while some below 64 can't be."""
    verdict = two_step_test(50.0 + 10.0 * np.cos(2.0 * np.pi * GOLDEN * np.arange(cycles)), sensor_error=1.0)
    assert verdict.nature == "undetermined"
    why, _, hint = verdict.reason.partition("; ")
    assert why.startswith("does not repeat")
    said = "" if longest is None else f"with a sensor error {cycles} cycles show periods up to {longest} only"
    assert hint == said
    assert ";" not in two_step_test(50.0 + 30.0 * logistic(4.0, 300), sensor_error=1.0).reason, "chaos needs no hint"


@pytest.mark.parametrize("error", [-1e-9, np.inf, np.nan])
def test_an_error_that_no_sensor_has_is_refused(error):
    """Errors are finite, and none is the least."""
    with pytest.raises(DiagnosisError, match=r"^sensor_error = .* is out of range; allowed: 0 or more$"):
        two_step_test(np.ones(20), sensor_error=error)


@pytest.mark.parametrize("tolerance", [-0.1, 0.0, 1.0, 1.5, np.nan])
def test_a_tolerance_is_a_share(tolerance):
    """Nothing repeats exactly, and everything within its whole range."""
    with pytest.raises(DiagnosisError, match=r"^tolerance = .* is out of range; allowed: above 0, below 1$"):
        two_step_test(np.ones(20), tolerance=tolerance)


@pytest.mark.parametrize(("cycles", "found"), [(128, True), (126, False)])
def test_the_last_quarter_is_enough_for_exact_values(cycles, found):
    """Chaos for two thirds, then period three: seen where the last quarter holds 32 cycles."""
    chaos, settled = logistic(4.0, 85), logistic(3.83, cycles - 85)
    series = np.concatenate([chaos, settled])
    verdict = two_step_test(series, initial_transient=100)
    assert (verdict.period == 3) == found
    if found:
        assert verdict.settle_cycle == pytest.approx(85, abs=3)
        assert verdict.evidence["irregular_cycles"] == verdict.settle_cycle
    noisy = two_step_test(series, sensor_error=1e-6, initial_transient=100)
    assert noisy.period is None, "noise needs more"


def test_transient_chaos_is_longer_than_the_motion_may_take():
    """The cycles before it settles count; as many as allowed are a start, one more is transient chaos."""
    series = np.concatenate([logistic(4.0, 300), logistic(3.83, 600)])
    verdict = two_step_test(series)
    cycles = verdict.evidence["irregular_cycles"]
    assert (verdict.transient_chaos, verdict.horizon) == (cycles, 900)
    assert verdict.statement.nature == f"periodic, period 3, after {cycles} cycles of transient chaos"
    assert two_step_test(series, initial_transient=cycles).transient_chaos == 0
    assert two_step_test(series, initial_transient=cycles - 1).transient_chaos == cycles
    shortest = np.concatenate([logistic(4.0, 50, start=0.2), logistic(3.83, 600)])
    assert two_step_test(shortest).evidence["irregular_cycles"] == 50, "fewer are too few for the 0-1 test"


def test_chaos_before_a_slow_approach_counts_too():
    """A motion that nears a fixed point by 1 % a cycle after chaos does not repeat yet, and was chaotic before."""
    n = np.arange(400)
    nearing = 0.5 + 0.05 * 0.99**n
    series = np.concatenate([logistic(4.0, 300), nearing])[:, None]
    verdict = two_step_test(series)
    assert (verdict.nature, verdict.period, verdict.settle_cycle) == ("periodic", 1, None)
    assert verdict.transient_chaos == pytest.approx(300, abs=3)
    assert verdict.labelled("thesis").nature == "periodic", "its history does not repeat"
    assert two_step_test(nearing).transient_chaos == 0


def test_a_long_regular_start_is_no_chaos():
    """A torus that gives way to a period wanders nowhere, and a slow decay dies out."""
    torus = np.concatenate([circle(0.3, GOLDEN, 300) / 3.0, logistic(3.83, 600)])
    n = np.arange(900)
    decay = 1.0 + 0.5 * np.exp(-n / 40.0) * (-1.0) ** n
    for series in (torus, decay):
        verdict = two_step_test(series)
        assert (verdict.nature, verdict.evidence["irregular_cycles"]) == ("periodic", 0)


def test_a_period_that_is_longer_than_asked_for_is_not_found():
    """Of 16 values in turn none repeats within eight cycles."""
    assert two_step_test(logistic(3.567, 400), max_period=8).period is None
    noisy = np.tile(np.arange(50.0, 66.0), 40)
    assert two_step_test(noisy, sensor_error=0.1).period == 16
    assert two_step_test(noisy, sensor_error=0.1, max_period=8).period is None
    late = np.concatenate([logistic(4.0, 500), logistic(3.567, 400)])
    assert two_step_test(late).period == 16
    assert two_step_test(late, max_period=8).period is None
    slow = 50.0 + np.tile([0.0, 3.0, 1.0, 4.0], 100) + 0.99 ** np.arange(400)
    assert two_step_test(slow).period == 4
    assert two_step_test(slow, max_period=3).period is None


def _record(section, peaks):
    """A record of a machine that moved so; peaks of two sides."""
    section, state = np.column_stack([section, section]), MotionState(section[-1:], np.zeros(3))
    never = np.zeros((len(section), 2))
    moved = section[:, 0], section[:, 1]
    return CycleRecord(ImpactBeam(), section, *moved, peaks, never.astype(int), never, never, state)


def test_a_record_repeats_if_its_state_and_its_forces_do():
    """With a sensor error the forces alone are seen, of the sides that touch; without contact there are none."""
    chaos, still = logistic(4.0, 400), np.tile([1.0, 2.0], 200)
    one_side, none = np.column_stack([0.5 * still, np.zeros(400)]), np.zeros((400, 2))
    assert two_step_test(_record(still, one_side)).period == 2
    assert two_step_test(_record(chaos, none)).nature == "chaotic", "the side that never touches has no say"
    assert two_step_test(_record(still, np.column_stack([still, chaos]))).period is None
    heard = two_step_test(_record(chaos, one_side), sensor_error=0.01)
    assert (heard.nature, heard.period, heard.evidence["contact"]) == ("periodic", 2, True)
    assert two_step_test(_record(still, np.column_stack([0.1 * chaos, still])), sensor_error=0.01).period is None
    silent = _record(still, none)
    verdict = two_step_test(silent)
    assert verdict.evidence["contact"] is False
    assert verdict.reason == f"repeats every 2 cycles within {verdict.evidence['residual']:.1e}; there is no contact"
    only = "^the record has no contact, and a sensor error in newton applies to peak forces only$"
    with pytest.raises(DiagnosisError, match=only):
        two_step_test(silent, sensor_error=1.0)


def test_coordinates_that_do_not_move_have_no_say():
    """Step II looks at the first four that do."""
    chaos, torus = logistic(4.0, 1000), circle(0.3, GOLDEN, 1000)
    still = np.ones(1000)
    assert two_step_test(np.column_stack([still, still, chaos])).nature == "chaotic"
    both = two_step_test(np.column_stack([torus] * 2 + [still] + [chaos] * 3)).evidence["zero_one"]
    each = [two_step_test(series).evidence["zero_one"] for series in (torus, chaos)]
    assert both == pytest.approx(np.mean(each), rel=1e-12), "the median of two and two"


def test_a_dead_contact_is_not_judged():
    """A contact that never carries force has no nature."""
    reason = "the series is zero throughout: there is no contact to judge"
    assert two_step_test(np.zeros(100)) == _undetermined({"cycles": 100}, reason)


def test_a_constant_response_has_period_one():
    """A settled period-1 motion is the same to the last bit."""
    assert two_step_test(np.full(50, 48.9)).period == 1


@pytest.mark.parametrize(
    ("series", "message"),
    [
        (np.ones(15), "15 cycles; allowed: 16 or more"),
        (np.where(np.arange(40) == 7, np.nan, 1.0), "not finite, first at 7"),
        (np.ones((20, 2, 2)), "shape"),
    ],
)
def test_unusable_series_are_refused(series, message):
    """Too short, not finite or of a wrong shape: the error says which."""
    with pytest.raises(DiagnosisError, match=message):
        two_step_test(series)


@settings(max_examples=25, deadline=None)
@given(factor=st.floats(1e-3, 1e6), r=st.sampled_from([2.8, 3.5, 3.6, 3.83, 4.0]))
def test_units_do_not_matter(factor, r):
    """The verdict is the same in newton and in kilonewton."""
    series = logistic(r, 300)
    assert two_step_test(factor * series).nature == two_step_test(series).nature


@pytest.mark.parametrize(("frequency", "nature"), [(10.0, "periodic"), (19.0, "periodic"), (30.0, "chaotic")])
def test_the_beam_of_the_thesis(frequency, nature):
    """At +-0.127 mm: periodic at 10 and 19 Hz (thesis figure 3.6), chaotic at 30 Hz (figure 3.7)."""
    verdict = two_step_test(simulate(ImpactBeam(excitation_frequency=frequency), 200, transient=200))
    assert verdict.nature == nature
    assert json.dumps(verdict.as_dict())


def test_a_beam_that_does_not_touch_is_periodic():
    """Linear motion inside a wide gap repeats every cycle, and the verdict says that there is no contact."""
    verdict = two_step_test(simulate(ImpactBeam(clearance=0.1), 60, transient=200))
    assert (verdict.nature, verdict.period) == ("periodic", 1)
    assert "no contact" in verdict.reason


def test_a_series_that_looks_random_is_warned_of():
    """The test is for exact series: normal noise is chaotic to it, and the reason warns; not so of the logistic map."""
    noise = 100.0 + 6.0 * np.random.default_rng(0).normal(size=500)
    assert "for measured readings use judge_peaks" in two_step_test(noise).reason
    assert "judge_peaks" not in two_step_test(logistic(3.9, 500)).reason
