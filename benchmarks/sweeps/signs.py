"""How often the signs of chaos of thesis 5.3 are right, counted on a dataset of crosses.

The printed criteria are right where the point itself is not periodic. A precursor on a periodic response is right where
the response is not periodic at some point of its cross: one tolerance of speed or of clearance away. A case of 5.5.1,
told from the four arms of a cross, is right of its middle where that is periodic in case I, and not periodic in the
others.

    python -m benchmarks.sweeps.signs datasets/impact-beam/whole datasets/slider-crank/whole
"""

import json
import sys
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.diagnosis.precursors import Rate, precursors, predictive_criteria
from chaosgym.diagnosis.type_rule import CROSS, mixed
from chaosgym.errors import DatasetError
from chaosgym.files import write_atomically
from chaosgym.sweeps.dataset import LabelledSweep, read_sweep

Array = NDArray[np.bool_]

KEPT = Path("src/chaosgym/diagnosis/signs.json")


def sign_rates(sweep: LabelledSweep) -> dict[str, Rate]:
    """Rates by sign; points that are undetermined, or beside such a point, are left out.

    Raises
    ------
    DatasetError
        If the dataset is not one of crosses.
    """
    if sweep.plan.sampling != "crosses":
        raise DatasetError(
            f"sampling = {sweep.plan.sampling!r} has no crosses; needed: a sweep with --sampling crosses:N"
        )
    natures = np.array([nature or "undetermined" for nature in sweep.column("nature")]).reshape(-1, len(CROSS))
    known = natures != "undetermined"
    chaos = known & (natures != "periodic")
    rows = np.arange(0, natures.size, len(CROSS))
    points = {name: sweep.column(name)[rows] for name in sweep.plan.fields}
    machines = [
        sweep.plan.machine_at({name: float(column[k]) for name, column in points.items()}) for k in range(len(rows))
    ]
    expected = [predictive_criteria(machine).chaos_possible for machine in machines]
    rates = {"criteria": _rate(np.array(expected)[known[:, 0]], chaos[known[:, 0], 0])}
    calm = known.all(axis=1) & ~chaos[:, 0]
    near = chaos[calm, 1:].any(axis=1)
    periods, bouncing = sweep.column("period")[rows][calm], sweep.column("bounce_fraction")[rows][calm]
    early = [precursors(int(period), float(share)) for period, share in zip(periods, bouncing, strict=True)]
    rates["period doubling"] = _rate([one.period_doubling for one in early], near)
    rates["period three"] = _rate([one.period_three for one in early], near)
    rates["long bouncing"] = _rate([one.long_bouncing for one in early], near)
    whole = known.all(axis=1)
    told = np.array([_case(row) for row in chaos[whole, 1:]])
    middle = chaos[whole, 0]
    for case in ("I", "II", "II throughout", "III"):
        rates[f"case {case}"] = _rate(told == case, middle != (case == "I"))
    return rates


def _case(restless: Array) -> str:
    """Case of 5.5.1 of the four arms of a cross, of which some are not periodic."""
    arms = [{"speed": float(speed), "clearance": float(gap)} for speed, gap in CROSS[1:]]
    calm, wild = ([arm for arm, is_so in zip(arms, row, strict=True) if is_so] for row in (~restless, restless))
    if not wild:
        return "I"
    if not calm:
        return "II throughout"
    return "III" if mixed(wild, calm) else "II"


def _rate(told: ArrayLike, true: ArrayLike) -> Rate:
    said, was = np.asarray(told, dtype=bool), np.asarray(true, dtype=bool)
    precision = round(float(was[said].mean()), 4) if said.any() else None
    recall = round(float(said[was].mean()), 4) if was.any() else None
    return Rate(precision, recall, len(said))


def main(folders: list[str]) -> None:
    """Count on datasets and keep the rates for the library."""
    found = {}
    for folder in folders:
        sweep = read_sweep(Path(folder))
        found[sweep.plan.machine.name] = {name: rate._asdict() for name, rate in sign_rates(sweep).items()}
    text = json.dumps(found, indent=1) + "\n"
    write_atomically(KEPT, lambda temporary: temporary.write_text(text))


if __name__ == "__main__":
    main(sys.argv[1:])
