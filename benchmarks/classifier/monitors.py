"""Delays, false alarms and alarms at harmless changes of monitors of peak forces.

The shipped monitor, the same cumulative sum of one lag, the repeat rule and permutation entropy on sliding windows, and
the learned probability of an irregular window.
"""

from collections.abc import Callable, Sequence
from math import factorial, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.classifier.changes import AFTER, SENSOR_ERROR, Trace
from chaosgym.classifier import MachineClassifier
from chaosgym.recordings.monitor import CAP, DRIFT, LIMIT, Monitor
from chaosgym.series.stroboscopic import noisy_class_residuals

Alarms = NDArray[np.bool_]
Watcher = Callable[[NDArray[np.float64]], Alarms]

REPEAT, ENTROPY, LEARNED = 16, 32, 16
"""Cycles of the sliding windows of the repeat rule, of permutation entropy, and of the learned one."""

ORDER, DISORDERED = 3, 0.9
"""Length of the patterns of permutation entropy, and share of the largest entropy from which on it is an alarm."""

MERGED = 64
"""Cycles within which alarms are one episode."""


def shipped(peaks: NDArray[np.float64]) -> Alarms:
    """The monitor of ``chaosgym.recordings.monitor``."""
    return np.array([bool(seen.alarm) for seen in Monitor(SENSOR_ERROR).watch(peaks)])


def one_lag(peaks: NDArray[np.float64]) -> Alarms:
    """The same sum of one lag, the period that fits the first 50 cycles best."""
    early = peaks[:50]
    lag = 1 + int(np.argmin([np.abs(early[k:] - early[:-k]).mean() for k in range(1, 9)]))
    out, total = np.zeros(len(peaks), bool), 0.0
    for n in range(lag, len(peaks)):
        total = max(0.0, total + min(abs(peaks[n] - peaks[n - lag]) / (2.0 * SENSOR_ERROR), CAP) - DRIFT)
        out[n] = total > LIMIT
    return out


def _sliding(peaks: NDArray[np.float64], cycles: int, judge: Callable[[NDArray[np.float64]], bool]) -> Alarms:
    out = np.zeros(len(peaks), bool)
    for end in range(cycles, len(peaks) + 1):
        out[end - 1] = judge(peaks[end - cycles : end])
    return out


def repeat_rule(peaks: NDArray[np.float64]) -> Alarms:
    """No period up to a quarter of the last 16 cycles explains them within the sensor's error."""
    return _sliding(peaks, REPEAT, lambda x: bool(noisy_class_residuals(x[:, None], REPEAT // 4).min() > SENSOR_ERROR))


def permutation_entropy(peaks: NDArray[np.float64]) -> Alarms:
    """The order patterns of three among the last 32 cycles are all about as frequent."""

    def disordered(x: NDArray[np.float64]) -> bool:
        patterns = np.argsort(np.lib.stride_tricks.sliding_window_view(x, ORDER), axis=1) @ (1, ORDER, ORDER**2)
        shares = np.unique(patterns, return_counts=True)[1] / len(patterns)
        return bool(-np.sum(shares * np.log(shares)) > DISORDERED * log(factorial(ORDER)))

    return _sliding(peaks, ENTROPY, disordered)


def learned(classifier: MachineClassifier) -> Watcher:
    """The probability of the record classifier over the last 16 cycles exceeds a half."""
    model = classifier.records["record-irregular"]

    def watch(peaks: NDArray[np.float64]) -> Alarms:
        windows = np.lib.stride_tricks.sliding_window_view(peaks, LEARNED)
        chances = model.predict_proba(windows, sensor_error=np.full(len(windows), SENSOR_ERROR))[:, 1]
        return np.concatenate([np.zeros(LEARNED - 1, bool), chances > 0.5])

    return watch


def compare_monitors(classifier: MachineClassifier, found: Sequence[Trace]) -> dict[str, Any]:
    """Scores of every monitor on traces, by name; see ``score``."""
    watchers: dict[str, Watcher] = {
        "shipped: cumulative sum, 8 lags": shipped,
        "cumulative sum, one lag": one_lag,
        f"repeat rule, {REPEAT}": repeat_rule,
        f"permutation entropy, {ENTROPY}": permutation_entropy,
        f"learned, {LEARNED}": learned(classifier),
    }
    return {name: score(watch, found) for name, watch in watchers.items()}


def score(watch: Watcher, found: Sequence[Trace]) -> dict[str, float]:
    """False alarms, delays and harmless alarms of one monitor.

    Returns
    -------
    dict
        ``false_alarms`` per 10,000 regular cycles, of ``cycles``; ``delay``: median cycles to the alarm, of near and of
        far changes too, and the 90th percentile; ``missed``: share of these changes without an alarm in 100 cycles;
        ``harmless``: share of the changes from regular to regular with one.
    """
    episodes, cycles = 0, 0
    delays: dict[bool, list[float]] = {True: [], False: []}
    harmless: list[bool] = []
    for trace in found:
        alarms = watch(trace.peaks)
        episodes += _episodes(alarms[: trace.change])
        cycles += trace.change
        late = np.flatnonzero(alarms[trace.change :])
        if trace.kind == "to irregular":
            delays[trace.near].append(float(late[0] + 1) if len(late) else np.inf)
        elif trace.kind == "to regular":
            harmless.append(bool(len(late)))
    whole = np.array([*delays[True], *delays[False]])
    return {
        "false_alarms": 1e4 * episodes / cycles,
        "cycles": float(cycles),
        "delay": float(np.median(whole)),
        "delay_near": float(np.median(delays[True])),
        "delay_far": float(np.median(delays[False])),
        "delay_90": float(np.percentile(whole, 90.0, method="higher")),
        "missed": float(np.mean(whole > AFTER)),
        "harmless": float(np.mean(harmless)),
        "changes": float(len(whole) + len(harmless)),
    }


def _episodes(alarms: Alarms) -> int:
    """Alarms, those within 64 cycles of each other counted once."""
    at = np.flatnonzero(alarms)
    return int(len(at) > 0) + int(np.sum(np.diff(at) > MERGED))


def monitor_table(name: str, scores: dict[str, Any]) -> list[str]:
    """Markdown lines of ``compare_monitors``."""
    first = next(iter(scores.values()))
    lines = [
        f"{name}: {first['cycles']:,.0f} regular cycles, {first['changes']:.0f} changes",
        "",
        "| monitor | false alarms per 10,000 | delay: near, far, all, 90 % | missed | harmless changes alarmed |",
        "|---|---|---|---|---|",
    ]
    for watcher, row in scores.items():
        delay = ", ".join(f"{row[key]:.0f}" for key in ("delay_near", "delay_far", "delay", "delay_90"))
        lines.append(
            f"| {watcher} | {row['false_alarms']:.1f} | {delay} | {row['missed']:.1%} | {row['harmless']:.1%} |"
        )
    return lines
