"""The monitor: quiet while peaks repeat, an alarm soon after they do not, and quiet again."""

import pickle

import numpy as np
import pytest

from chaosgym.errors import ChaosgymError, DiagnosisError
from chaosgym.recordings.monitor import DEAD, JUDGED, LAGS, LONGEST, EventLog, Monitor, RepeatSums
from tests.classifier.made_up import settled

ERROR = 1.0


def noisy(record, seed):
    """A record as a sensor of +-1 N reads it."""
    return record + np.random.default_rng(seed).uniform(-ERROR, ERROR, len(record))


def events(peaks):
    """(cycle, event) of everything that happens."""
    return [(seen.cycle, seen.event) for seen in Monitor(ERROR).watch(peaks) if seen.event]


@pytest.mark.parametrize("rate", [2.6, 3.2, 3.5, 3.55])
def test_repeating_peaks_raise_no_alarm(rate):
    """Periods of 1, 2, 4 and 8 cycles through noise, 5,000 cycles each."""
    assert events(noisy(settled(rate, 5000), 1)) == []


def test_chaos_is_seen_within_a_few_cycles():
    """From a period of 2 into chaos: an alarm within 8 cycles in nine runs of ten."""
    delays = []
    for seed in range(40):
        peaks = np.concatenate([settled(3.2, 60), settled(3.9, 60 + seed)[seed:]])
        alarms = [cycle for cycle, event in events(noisy(peaks, seed)) if event == "alarm"]
        delays.append(alarms[0] - 60 if alarms else 99)
    assert min(delays) >= 1
    assert np.percentile(delays, 90) <= 8


def test_a_jump_between_two_regular_regimes_is_a_change_and_no_alarm():
    """A level that moves by 20 N is noted in the cycle of the jump."""
    found = events(noisy(np.concatenate([np.full(60, 40.0), np.full(60, 60.0)]), 3))
    assert found == [(61, "change")]


def test_the_alarm_ends_when_the_peaks_repeat_again():
    """Back from chaos it is all clear within two dozen cycles, once, without flicker."""
    peaks = noisy(np.concatenate([settled(3.2, 60), settled(3.9, 60), settled(3.2, 120)]), 4)
    kinds = [event for _, event in events(peaks) if event != "change"]
    assert kinds == ["alarm", "all clear"]
    clear = next(cycle for cycle, event in events(peaks) if event == "all clear")
    assert 120 < clear <= 120 + 24 + LAGS


def test_scatter_within_the_sensor_error_is_regular():
    """Chaos of +-0.8 N is noise to a sensor of 3 N, and an alarm to one of 0.1 N."""
    weak = 40.0 + 0.04 * (settled(3.9, 400) - 40.0)
    assert not any(seen.alarm for seen in Monitor(3.0).watch(weak))
    assert sum(bool(seen.alarm) for seen in Monitor(0.1).watch(weak)) > 350


def test_the_first_cycles_wait():
    """Until every period could repeat there is no verdict."""
    seen = list(Monitor(ERROR).watch(settled(3.9, 40)))
    assert [one.alarm for one in seen[: 2 * LAGS]] == [None] * 2 * LAGS
    assert seen[-1].alarm
    assert "waiting" in str(seen[0])
    assert "IRREGULAR" in str(seen[-1])


def test_amplitude_counts_from_the_last_change():
    """After a jump between levels the amplitude is that of the new regime, not of the jump."""
    peaks = np.concatenate([np.full(60, 40.0), np.full(60, 60.0)])
    assert list(Monitor(ERROR).watch(noisy(peaks, 5)))[-1].amplitude < 1.2


def pink(rng, cycles):
    """1/f noise with a standard deviation of 1."""
    frequency = np.fft.rfftfreq(cycles)
    spectrum = rng.normal(size=len(frequency)) + 1j * rng.normal(size=len(frequency))
    spectrum[1:] /= np.sqrt(frequency[1:])
    spectrum[0] = 0.0
    made = np.fft.irfft(spectrum, cycles)
    return made / made.std()


def volatile(rng, cycles):
    """GARCH(1, 1), Bollerslev (1986), with a standard deviation of 1: scatter that comes in bursts."""
    made, variance = np.empty(cycles), 1.0
    for cycle in range(cycles):
        made[cycle] = np.sqrt(variance) * rng.normal()
        variance = 0.05 + 0.2 * made[cycle] ** 2 + 0.75 * variance
    return made / made.std()


SCATTERS = {
    "pink 1 %": pink,
    "white 6 %": lambda rng, n: 6.0 * rng.normal(size=n),
    "hum 2 %": lambda rng, n: 2.0 * np.sin(2.0 * np.pi * rng.uniform(0.05, 0.45) * np.arange(n)),
    "bursts 4 %": lambda rng, n: 4.0 * volatile(rng, n),
}


@pytest.mark.parametrize("stated", [0.4, None])
@pytest.mark.parametrize("kind", SCATTERS)
def test_the_scatter_of_the_process_is_no_alarm_whatever_is_stated(kind, stated):
    """Noise of many kinds, and a sensor of 0.4 N, stated or not: no alarm in 1,000 cycles of four records."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        peaks = 100.0 + SCATTERS[kind](rng, 1000) + rng.uniform(-0.4, 0.4, 1000)
        assert {seen.event for seen in Monitor(stated).watch(np.maximum(peaks, 0.0))} <= {"", "change"}


@pytest.mark.parametrize(("noise", "size", "within"), [(0.0, 1.0, 30), (1.0, 5.0, 60)])
def test_chaos_that_begins_is_new(noise, size, within):
    """Chaos of 1 % is noticed after 30 cycles, and of 5 % under pink noise of 1 % within 60, the error stated."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        chaos = settled(3.9, 200)
        peaks = 100.0 + noise * pink(rng, 400) + rng.uniform(-0.4, 0.4, 400)
        peaks[200:] += size * (chaos - chaos.mean()) / chaos.std()
        alarms = [seen.cycle for seen in Monitor(0.4).watch(peaks) if seen.event == "alarm"]
        assert 200 < alarms[0] <= 200 + within


def test_chaos_from_the_first_reading_is_told_without_a_stated_error():
    """Chaos of 3 %, no error stated: the first 128 cycles are called irregular, and the alarm goes on within 20."""
    for rate in (3.7, 3.78, 3.9, 3.98):
        rng = np.random.default_rng([21, int(100 * rate)])
        chaos = settled(rate, 200)
        peaks = 100.0 + 3.0 * (chaos - chaos.mean()) / chaos.std() + rng.uniform(-0.4, 0.4, 200)
        told = [(seen.event, seen.cycle) for seen in Monitor().watch(peaks) if seen.event not in ("", "change")]
        assert [event for event, _ in told[:2]] == ["irregular from the start", "alarm"]
        assert told[0][1] in JUDGED
        assert told[1][1] <= told[0][1] + 20


@pytest.mark.slow
def test_of_chaos_from_the_start_most_is_told_and_of_noise_none():
    """Ten records each: of chaos of four sizes three quarters are told, of noise of six kinds none."""

    def told(made, seed):
        peaks = np.maximum(100.0 + made + np.random.default_rng([23, seed]).uniform(-0.4, 0.4, 140), 0.0)
        return "irregular from the start" in [seen.event for seen in Monitor().watch(peaks)]

    def chaos(rate, seed):
        found = settled(rate, 300)[11 * seed :][:140]
        return (found - found.mean()) / found.std()

    def correlated(rng, step):
        found = [0.0]
        for _ in range(239):
            found.append(step(found[-1]) + 1.2 * rng.normal())
        return np.array(found[100:]) / np.std(found[100:])

    of_noise = SCATTERS | {
        "AR(0.9) 1 %": lambda rng, n: correlated(rng, lambda x: 0.9 * x),
        "threshold AR 1 %": lambda rng, n: correlated(rng, lambda x: 0.5 * x + (1.5 if x > 0.0 else -1.5)),
    }
    of_chaos = {
        "1 %": lambda seed: chaos(3.9, seed),
        "3 %": lambda seed: 3.0 * chaos(3.7, seed),
        "5 %": lambda seed: 5.0 * chaos(4.0, seed),
        "5 %, pink 1 %": lambda seed: 5.0 * chaos(3.9, seed) + pink(np.random.default_rng([24, seed]), 140),
    }
    found = {kind: sum(told(made(seed), seed) for seed in range(10)) for kind, made in of_chaos.items()}
    false = {
        kind: sum(told(made(np.random.default_rng([25, seed]), 140), seed) for seed in range(10))
        for kind, made in of_noise.items()
    }
    print(found, false)
    assert sum(false.values()) == 0
    assert sum(found.values()) >= 30


def test_it_is_all_clear_where_chaos_from_the_start_ends():
    """Chaos of 3 % for 150 cycles, then one level: an alarm, and the all-clear within two dozen cycles."""
    chaos = settled(3.9, 150)
    peaks = np.concatenate([100.0 + 3.0 * (chaos - chaos.mean()) / chaos.std(), np.full(100, 100.0)])
    peaks += np.random.default_rng(22).uniform(-0.4, 0.4, 250)
    kinds = [(seen.event, seen.cycle) for seen in Monitor().watch(peaks) if seen.event not in ("", "change")]
    assert [kind for kind, _ in kinds] == ["irregular from the start", "alarm", "all clear"]
    assert 150 < kinds[-1][1] <= 174


@pytest.mark.parametrize("kind", ["pink, learned", "normal, learned", "sensor 1.5 times worse", "periods 9, 12 and 16"])
def test_harmless_scatter_raises_no_alarm_in_thousands_of_cycles(kind):
    """Pink noise of 1 % with a learned error, a sensor that is worse than told, and long periods: no alarm."""
    rng = np.random.default_rng(7)
    runs = {
        "pink, learned": lambda: [(None, 50.0 + 0.5 * pink(rng, 5000))],
        "normal, learned": lambda: [(None, 50.0 + 0.5 * rng.normal(size=5000))],
        "sensor 1.5 times worse": lambda: [(1.0, 50.0 + 1.5 * rng.uniform(-1.0, 1.0, 5000))],
        "periods 9, 12 and 16": lambda: [
            (1.0, np.resize(50.0 + 20.0 * rng.random(k), 1700) + rng.uniform(-1.0, 1.0, 1700)) for k in (9, 12, 16)
        ],
    }[kind]()
    seen = [[one.event for one in Monitor(error, longest_period=LONGEST).watch(peaks)] for error, peaks in runs]
    assert sum(events.count("alarm") for events in seen) == 0


def test_a_learned_error_still_finds_chaos():
    """After 64 regular cycles chaos raises the alarm within 16 cycles, and the state tells the learned error."""
    monitor = Monitor()
    list(monitor.watch(noisy(settled(3.2, 100), 1)))
    assert monitor.state["sensor_error"] == pytest.approx(1.1 * ERROR, rel=0.3)
    alarms = [seen.cycle for seen in monitor.watch(noisy(settled(3.9, 60), 2)) if seen.event == "alarm"]
    assert alarms[0] <= 116


def test_a_dead_sensor_and_missing_cycles_are_events():
    """Equal readings after others, and zeros; a missing cycle keeps the phase, so that period 3 goes on."""
    told = []
    monitor = Monitor(ERROR, on_event=lambda seen: told.append((seen.cycle, seen.event)))
    list(monitor.watch(noisy(np.full(70, 50.0), 3)))
    list(monitor.watch(np.full(2 * DEAD, 50.0)))
    assert told == [(70 + DEAD, "dead sensor")]
    assert monitor.state["dead"]
    told.clear()
    monitor.reset()
    for cycle, peak in enumerate(noisy(np.resize([40.0, 50.0, 60.0], 300), 4)):
        monitor.skip() if cycle == 100 else monitor.update(peak)
    assert told == [(101, "missing")]
    assert monitor.state["missing"] == 1


@pytest.mark.parametrize("peak", [-1.0, np.nan, np.inf])
def test_bad_peaks_are_named_and_not_counted(peak):
    """A reading that is no force raises; the monitor goes on as if it had not come."""
    monitor = Monitor(ERROR)
    monitor.update(40.0)
    with pytest.raises(DiagnosisError, match="cycle 2: peak"):
        monitor.update(peak)
    assert monitor.update(40.0).cycle == 2


def test_the_sensor_error_must_be_stated():
    """A perfect sensor has no scale by which to judge."""
    with pytest.raises(DiagnosisError, match="allowed: above 0"):
        Monitor(0.0)


def test_the_log_holds_every_event(tmp_path):
    """One line an event, appended; a file that can't be written is named."""
    peaks = noisy(np.concatenate([settled(3.2, 60), settled(3.9, 60)]), 6)
    for _ in range(2):
        with EventLog(tmp_path / "log.csv") as log:
            for seen in Monitor(ERROR).watch(peaks):
                log.note(seen)
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert lines[0] == "cycle,event,peak_N,amplitude_N"
    assert sum("alarm" in line for line in lines) >= 2
    with pytest.raises(ChaosgymError, match="can't be written"):
        EventLog(tmp_path / "no" / "log.csv")


def test_monitors_side_by_side_are_monitors():
    """The sums of three sensors, one of which starts anew on the way, are those of a monitor each, bit for bit."""
    peaks = 50.0 + np.random.default_rng(0).uniform(-4.0, 4.0, (40, 3))
    sums, monitors = RepeatSums(3), [Monitor(5.0) for _ in range(3)]
    for cycle, row in enumerate(peaks):
        if cycle == 15:
            sums.forget(np.array([1]))
            monitors[1].reset()
        sums.add(np.arange(3), row, 5.0)
        levels = [monitor.update(float(peak)).level for monitor, peak in zip(monitors, row, strict=True)]
        assert np.array_equal(sums.level(np.arange(3)), levels)


def test_a_long_watch_takes_no_more_memory():
    """What a monitor keeps is as large after 6,000 readings as after 500, and it still hears chaos at once."""
    monitor, sizes = Monitor(sensor_error=1.0), {}
    for watch in monitor.watch(50.0 + 10.0 * (np.arange(6000) % 2)):
        if watch.cycle in (500, 6000):
            sizes[watch.cycle] = len(pickle.dumps(vars(monitor)))
        assert not watch.alarm
    assert sizes[6000] <= sizes[500] + 16  # numbers themselves have more digits
    alarms = [watch.cycle for watch in monitor.watch(settled(3.9, 40)) if watch.alarm]
    assert alarms
    assert alarms[0] < 6000 + 16
