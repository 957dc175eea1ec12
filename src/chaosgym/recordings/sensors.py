r"""One verdict on a machine from several sensors: what all agree on, or what their readings show together.

Readings of two surfaces follow each other within a cycle. Each is forecast from the last ones of both, over a part of
the cycle only, in which less of what is known is lost (``determinism``). So chaos shows that hides from one sensor.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.chaos import chaotic, is_chaotic
from chaosgym.recordings.few_lines import slipped_torus
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.scatter import Scatter, scatter_of
from chaosgym.series.determinism import determinism
from chaosgym.series.noise import quantum, repair
from chaosgym.series.transient_chaos import CHAOTIC_CYCLES
from chaosgym.series.verdict import undetermined

UNSTEADY = "not a steady response"
"""How the reason of a verdict begins that no further sensor can change."""


def judge_together(verdicts: Sequence[MeasuredVerdict], peaks: Array, names: Sequence[str]) -> MeasuredVerdict:
    """The verdict of several sensors on one machine.

    Parameters
    ----------
    verdicts
        That of each sensor alone.
    peaks : (cycles, sensors)
        Readings, one a cycle of each, at least two sensors.
    names
        Of the sensors, for people.

    Notes
    -----
    A sensor without any reading but zero does not count. The others must agree; where none of them decides, all are
    asked together. Chaos and a torus need one sensor that shows them and none that repeats. A sensor that repeats only
    if its scatter is random decides nothing against another.
    """
    live = [place for place in range(len(verdicts)) if np.any(peaks[:, place])]
    if len(live) < 2:
        return verdicts[live[0] if live else 0]
    alone = [verdicts[place] for place in live]
    told = "; ".join(f"{names[place]}: {verdicts[place].diagnosis.words}" for place in live)
    natures = {verdict.diagnosis.nature for verdict in alone}
    if natures == {"periodic"}:
        return _periodic(alone, [names[place] for place in live])
    firm = {verdict.diagnosis.nature for verdict in alone if not verdict.diagnosis.condition}
    if len(firm - {"undetermined"}) > 1 or "periodic" in firm:
        return _open(f"the sensors do not agree: {told}", peaks, alone)
    for nature in ("chaotic", "quasiperiodic"):
        if nature in natures:
            shown = next(place for place in live if verdicts[place].diagnosis.nature == nature)
            found = verdicts[shown]
            reason = f"{names[shown]}: {found.diagnosis.reason}"
            return replace(found, diagnosis=replace(found.diagnosis, reason=reason))
    return _asked_together(alone, peaks[:, live], [names[place] for place in live])


def _periodic(alone: Sequence[MeasuredVerdict], names: Sequence[str]) -> MeasuredVerdict:
    """All sensors repeat: the period of the machine is the least common multiple of theirs."""
    period = math.lcm(*(verdict.diagnosis.period or 1 for verdict in alone))
    widest = max(alone, key=lambda verdict: verdict.coefficient_of_variation or 0.0)
    reason = "; ".join(f"{name}: {verdict.diagnosis.reason}" for name, verdict in zip(names, alone, strict=True))
    margin = min(verdict.diagnosis.margin for verdict in alone)
    diagnosis = replace(widest.diagnosis, period=period, reason=reason, margin=margin)
    return replace(widest, diagnosis=diagnosis, random=any(verdict.random for verdict in alone))


def _asked_together(alone: Sequence[MeasuredVerdict], peaks: Array, names: Sequence[str]) -> MeasuredVerdict:
    """Chaos in the maps of all sensors together, or undetermined."""
    if any(verdict.diagnosis.reason.startswith(UNSTEADY) or verdict.changes for verdict in alone):
        return alone[0]
    several = _scatters(peaks)
    if several is None or len(peaks) < CHAOTIC_CYCLES:
        first = alone[0].diagnosis
        return _open(f"no sensor decides: {first.reason}", peaks, alone, first.tells_more)
    fitted = determinism(np.column_stack([found.readings for found in several]))
    if not is_chaotic(several, fitted) or any(slipped_torus(found, None) for found in several):
        reason = f"{' and '.join(names)} together: random or chaotic, these sensors cannot tell"
        return _open(reason, peaks, alone, ("more cycles", "another speed", "the machine's model"))
    found = chaotic(several, fitted, None, [names[place] for place in fitted.order])
    widest = max(several, key=lambda one: one.relative)
    return replace(found, scatter=widest.sigma, coefficient_of_variation=widest.relative, unit=alone[0].unit)


def _scatters(peaks: Array) -> list[Scatter] | None:
    """Scatter of each sensor; None if cycles are missing in one, so that readings of a row may not belong together."""
    found = []
    for readings in peaks.T:
        whole, _, gaps = repair(readings)
        if gaps or not np.ptp(whole):
            return None
        found.append(scatter_of(whole, 0.5 * quantum(readings) / math.sqrt(3.0)))
    return found


def _open(
    reason: str, peaks: Array, alone: Sequence[MeasuredVerdict], tells_more: tuple[str, ...] = ()
) -> MeasuredVerdict:
    return MeasuredVerdict(undetermined(reason, peaks, tells_more), alone[0].error, unit=alone[0].unit)
