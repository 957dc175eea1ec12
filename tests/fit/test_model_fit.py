"""The model of a machine tells a noisy periodic record from a chaotic one, how wide the gap is, and that it is wrong.

``python -m tests.fit.test_model_fit 8`` prints what it tells of eight machines of each kind.
"""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chaosgym import ImpactBeam, SliderCrank, read_machine, simulate
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.diagnosis.response_type import default_tolerances
from chaosgym.errors import DiagnosisError
from chaosgym.fit.model_draws import Draw, figures, names_of
from chaosgym.fit.model_fit import ModelFit, _worst, model_fit, with_record
from chaosgym.machines.machine_file import template
from chaosgym.machines.parameters import with_settings
from chaosgym.recordings.judge import judge_peaks
from tests.plain_modes import HARD_BEAM
from tests.third_machine import ImpactOscillator

DOCS = Path(__file__).parents[2] / "docs"


def another(nominal, rng):
    """A machine of the same family: every number with a tolerance lies within it, away from the nominal one."""
    shares = {field: rng.uniform(-1.0, 1.0) for field in default_tolerances(nominal)}
    given = {f: tol.at(getattr(nominal, f), shares[f]) for f, tol in default_tolerances(nominal).items()}
    return with_settings(nominal, given)


def noisy(machine, cycles, rng, ripple, sensor):
    """Readings (cycles, sides) with normal noise on speed, gap (half of it) and readings, fresh in every cycle."""
    fields = {machine.speed_field: ripple, machine.clearance_field: 0.5 * ripple}
    table = {f: getattr(machine, f) * (1.0 + size * rng.normal(size=cycles)) for f, size in fields.items()}
    peaks = simulate(machine, cycles, transient=400, operation=table).peak_force
    return peaks * (1.0 + sensor * rng.normal(size=peaks.shape))


def peaks_by_scipy(machine, cycles, noise, seed, settle=200):
    """Peaks (cycles,) at the upper stop of the oscillator by SciPy's Runge-Kutta pair, normal noise on each force."""
    rng, lasts, state, peaks = np.random.default_rng(seed), 1.0 / machine.frequency, np.zeros(2), []

    def push(x, v):
        above = machine.contact_stiffness * (x - machine.gap) + machine.contact_damping * v
        below = machine.contact_stiffness * (x + machine.gap) + machine.contact_damping * v
        stops = np.where(x < -machine.gap, np.minimum(below, 0.0), 0.0)
        return np.where(x > machine.gap, np.maximum(above, 0.0), stops)

    def slope(t, z, amplitude):
        drive = amplitude * np.cos(2.0 * np.pi * machine.frequency * t)
        rest = drive - machine.damping * z[1] - machine.stiffness * z[0] - float(push(*z))
        return [z[1], rest / machine.mass]

    for _ in range(settle + cycles):
        amplitude = machine.force_amplitude * (1.0 + noise * rng.normal())
        times = np.linspace(0.0, lasts, 800)
        path = solve_ivp(slope, (0.0, lasts), state, args=(amplitude,), t_eval=times, rtol=1e-6, max_step=lasts / 100.0)
        state = path.y[:, -1]
        peaks.append(float(push(*path.y).max()))
    return np.array(peaks[settle:])


@pytest.fixture(scope="module")
def beam():
    """A beam of period one (12 Hz), another of its family, and that one's upper surface over 96 noisy cycles.

    With a hard pivot the level rises with the gap. With a soft one it swings, and 1.7 times the gap fits as well.
    """
    nominal, rng = replace(HARD_BEAM, excitation_frequency=12.0), np.random.default_rng(5)
    true = another(nominal, rng)
    return nominal, true, noisy(true, 96, rng, 1e-3, 0.01)[:, 0]


@pytest.fixture
def few(monkeypatch):
    """A fit makes a tenth of its draws, in two rounds."""
    for name, value in (("FIRST", 12), ("LATER", 6), ("ROUNDS", 2)):
        monkeypatch.setattr(f"chaosgym.fit.model_fit.{name}", value)


def test_noise_around_one_level_is_periodic(beam):
    """1 % of scatter in 96 cycles, which the record alone can't tell from chaos, is noise on a periodic machine."""
    nominal, _, peaks = beam
    assert judge_peaks(peaks).diagnosis.nature == "undetermined"
    found = model_fit(nominal, peaks)
    assert (found.nature, found.period, found.fits) == ("periodic", 1, True)
    assert found.noise["sensor"] == pytest.approx(0.01, abs=0.005)
    assert sum(found.shares.values()) == pytest.approx(1.0)


@pytest.mark.usefixtures("few")
def test_the_same_seed_gives_the_same_answer(beam):
    """Draws are those of the seed."""
    nominal, _, peaks = beam
    first, second, other = (model_fit(nominal, peaks[:40], seed=seed) for seed in (3, 3, 4))
    assert first == second
    assert first != other


@pytest.mark.parametrize(("name", "draws"), [("cam-follower", "few"), ("kahraman-singh-1990", None)])
def test_a_record_without_noise_is_that_of_its_machine_file(name, draws, request):
    """Peaks that ``simulate`` wrote, all alike, fit the file that they are of, which is periodic."""
    if draws:
        request.getfixturevalue(draws)
    machine = read_machine(DOCS / "machines" / f"{name}.toml")
    found = model_fit(machine, machine.sensed(simulate(machine, 32, transient=200).peak_force))
    assert (found.fits, found.nature, found.period) == (True, "periodic", 1)


@pytest.mark.slow
@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("kind", ["modes", "slider-crank", "four-bar", "compressor"])
def test_machine_files_of_all_kinds_are_compared_with_their_records(kind, tmp_path):
    """Each template of new-machine, off its numbers, with noise, by a tenth of the draws: its nature, or none."""
    path = tmp_path / f"{kind}.toml"
    path.write_text(template(kind))
    nominal, rng = read_machine(path), np.random.default_rng(1)
    true = another(nominal, rng)
    found = model_fit(nominal, true.sensed(noisy(true, 128, rng, 1e-3, 3e-3)), estimate=["clearance"])
    assert found.nature in (diagnose_alone(true, budget=800).nature, "undetermined")
    assert found.draws > 0


@pytest.mark.slow
def test_a_gap_that_was_stated_wrongly_is_found(beam):
    """Told 1.7 times the gap, no machine within the tolerances fits; looked for, gap and nature are found."""
    nominal, true, peaks = beam
    wrong = with_settings(nominal, {"clearance": 1.7 * nominal.clearance})
    assert not model_fit(wrong, peaks).fits
    found = model_fit(wrong, peaks, estimate=["clearance"])
    one = found.estimates["clearance"]
    assert (found.nature, found.fits, one.told) == ("periodic", True, True)
    assert one.low < true.clearance < one.high < 1.3 * one.low


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "nature"), [(11.5, "periodic"), (7.6, "chaotic")])
def test_records_of_another_integrator_with_noise_on_the_force(frequency, nature, monkeypatch):
    """The oscillator by SciPy, off its nominal numbers, 0.5 % of noise on each cycle's force: most of the posterior.

    Some machines within the tolerances of the chaotic one are periodic, so its nature is told, or left open.
    """
    for name, value in (("FIRST", 60), ("LATER", 20)):
        monkeypatch.setattr(f"chaosgym.fit.model_fit.{name}", value)
    nominal = ImpactOscillator(frequency=frequency)
    true = ImpactOscillator(frequency=1.01 * frequency, gap=1.03e-3, damping=1.9)
    assert diagnose_alone(true, budget=800).nature == nature
    found = model_fit(nominal, peaks_by_scipy(true, 128, 0.005, 1))
    assert found.fits
    assert found.shares[nature] > 0.8
    assert found.nature == nature or (nature == "chaotic" and found.nature == "undetermined")


@pytest.mark.slow
def test_records_of_no_such_machine_do_not_fit():
    """A random walk in a band, an autoregressive load and the beam at another speed: the model does not fit."""
    nominal, rng = ImpactBeam(excitation_frequency=12.0), np.random.default_rng(6)
    level = simulate(nominal, 1, transient=200).peak_force[0, 0]
    load = np.zeros(200)
    for k in range(1, 200):
        load[k] = 0.95 * load[k - 1] + 0.31 * rng.normal()
    assert not model_fit(nominal, level * (1.0 + 0.15 * load)).fits
    other = noisy(nominal.at(26.0), 200, rng, 1e-3, 0.01)[:, 0]
    found = model_fit(nominal, other)
    assert found.nature == "undetermined"
    assert found.reason.startswith("the model does not fit: of 420 simulated records the nearest differs by")


@pytest.mark.usefixtures("few")
def test_a_fit_that_is_at_ease_ends_after_its_third_round(beam, monkeypatch):
    """Enough good draws at once: two rounds beside the first, and no fewer."""
    for name, value in (("ROUNDS", 5), ("MOST", 1), ("ENOUGH", np.inf)):
        monkeypatch.setattr(f"chaosgym.fit.model_fit.{name}", value)
    nominal, _, peaks = beam
    assert model_fit(nominal, peaks[:40]).draws == 12 + 6 + 6


def test_machines_of_no_period_give_a_model_of_no_period(beam, monkeypatch):
    """Every machine that agrees is chaotic: that is told, without a period."""
    chaotic = replace(diagnose_alone(beam[1], budget=400), nature="chaotic", period=None)
    monkeypatch.setattr("chaosgym.fit.model_fit.diagnose_alone", lambda *_, **__: chaotic)
    for name, value in (("FIRST", 12), ("LATER", 6), ("ROUNDS", 2), ("FEWEST", 1), ("FITS", np.inf)):
        monkeypatch.setattr(f"chaosgym.fit.model_fit.{name}", value)
    nominal, _, peaks = beam
    found = model_fit(nominal, peaks[:40], estimate=["clearance"])
    assert (found.nature, found.period, found.shares) == ("chaotic", None, {"chaotic": pytest.approx(1.0)})
    one = found.estimates["clearance"]
    assert 0.5 * nominal.clearance <= one.low < one.value < one.high <= 2.0 * nominal.clearance


@pytest.mark.parametrize(
    ("difference", "parts", "why"),
    [
        (3.0, [0.1, -3.0, 2.0], "differs by 3 times .* most in scatter, which is below the measured one"),
        (3.0, [3.0, -1.0, 2.0], "differs by 3 times .* most in mean, which is above the measured one"),
        (np.inf, [np.nan] * 3, "none has a force where the sensor reads one"),
    ],
)
def test_the_nearest_draw_says_in_what_it_differs(difference, parts, why):
    """The largest part counts, whatever its sign."""
    draw = Draw(np.zeros(1), difference, np.array(parts), 0.01, None)
    assert re.search(why, _worst(draw, names_of(1)[0]))


def test_record_and_model_that_contradict_each_other_decide_nothing():
    """A record that is chaotic by itself is not called periodic by a model; random scatter may be chaos."""
    told = {"reason": "", "fits": True, "shares": {}, "draws": 1, "accepted": 1, "difference": 0.1}
    fit = ModelFit(nature="periodic", period=1, noise={}, estimates={}, **told)
    x, chaos = 0.3, []
    for _ in range(500):
        x = 4.0 * x * (1.0 - x)
        chaos.append(50.0 + 10.0 * x)
    assert with_record(fit, judge_peaks(chaos)).nature == "undetermined"
    quiet = judge_peaks(50.0 + 0.2 * np.random.default_rng(7).normal(size=300))
    assert with_record(fit, quiet) is fit


def test_figures_describe_a_record():
    """Level and scatter are logarithms; a pattern of two is all of an alternation; sensors that agree correlate."""
    record = np.column_stack([np.resize([40.0, 60.0], 100)] * 2)
    told = dict(zip(names_of(2)[0], figures(record), strict=True))
    assert np.exp(told["mean"]) == pytest.approx(50.0)
    assert np.exp(told["scatter"]) == pytest.approx(0.2)
    assert told["pattern of 2"] == pytest.approx(1.0)
    assert told["pattern of 3"] == pytest.approx(0.0, abs=0.05)
    assert told["correlation of sensors"] == pytest.approx(1.0)
    assert told["correlation of sensors over 1"] == pytest.approx(-1.0, abs=0.05)


@pytest.mark.parametrize(
    ("peaks", "keywords", "why"),
    [
        (np.ones(31), {}, "has 31 cycles; a model is compared with 32 or more"),
        (np.ones((40, 2, 2)), {}, "allowed: \\(cycles,\\) or \\(cycles, sensors\\)"),
        (np.full(40, np.nan), {}, "not finite"),
        (np.zeros(40), {}, "mean reading is not above 0"),
        (np.exp(0.05 * np.arange(60)), {}, "not a steady response"),
        (np.ones(40), {"estimate": ["colour"]}, "'colour' can't be estimated; allowed: clearance, or a number"),
        (np.ones(40), {"estimate": ["n_modes"]}, "can't be estimated"),
        (np.ones(40), {"surfaces": [0, 1]}, "2 surfaces are named for 1 sensors"),
        (np.ones(40), {"surfaces": [7]}, "surface 7"),
        (np.ones(40), {"sensor_sigma": -1.0}, "out of range"),
    ],
)
def test_what_cannot_be_compared_is_refused(peaks, keywords, why):
    """One line that says what to do."""
    with pytest.raises(DiagnosisError, match=why):
        model_fit(ImpactBeam(), peaks, **keywords)


def told(kind, seed):
    """(truth, what the model says, interval of the gap in its own size) of a noisy machine of a random family."""
    rng = np.random.default_rng([seed, 47])
    while True:
        nominal = (
            ImpactBeam(excitation_frequency=rng.uniform(8.0, 32.0), clearance=rng.uniform(5e-5, 1.5e-4))
            if kind == "beam"
            else SliderCrank(crank_speed=rng.uniform(120.0, 270.0), slider_clearance=rng.uniform(3e-5, 2.5e-4))
        )
        true = another(nominal, rng)
        truth = diagnose_alone(true, budget=800)
        cycles, ripple, sensor = rng.choice([128, 256, 500]), rng.choice([1e-4, 1e-3, 3e-3]), rng.choice([1e-3, 1e-2])
        peaks = noisy(true, int(cycles), rng, ripple, sensor)
        if truth.nature != "undetermined" and peaks[:, 0].any():
            break
    found = model_fit(nominal, peaks[:, 0], estimate=["clearance"])
    gap, (one,) = getattr(true, true.clearance_field), found.estimates.values() or (None,)
    return truth.words, found, one and (one.low / gap, one.value / gap, one.high / gap)


if __name__ == "__main__":
    for kind in ("beam", "crank"):
        for seed in range(int(sys.argv[1])):
            truth, found, gap = told(kind, seed)
            print(kind, seed, truth, "->", found.words, f"{found.difference:.2f}", found.shares, gap, flush=True)
