"""Scores of a comparison: what each contender won, with intervals, and in words.

    score = (mean return - that of following the demand) / (that of the own map - that of following the demand)

The own map is the machine's map of Type III and of mean peaks at every speed, smoothed, with the demands to come
unknown. It is no bound on what a job returns: scores may exceed 1. Intervals draw machines, in pairs: the scale is
drawn along. What is won is told in the machine's terms too: the joint's life, and how many machines are made worse.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.control.statistics import bootstrap_interval, paired_difference, performance_profile
from chaosgym.errors import ParameterError
from chaosgym.rating_life import LIFE_EXPONENT

ZERO, ONE = "follow the demand", "own map"
"""Contenders that are worth 0 and 1."""

SAFE = "back off, with memory"
"""Contender without model and training: differences of return are reported against it."""

MADE_WORSE = 1.0
"""Return by which a job must fall short of that of following the demand for its machine to be counted as made worse."""

PROFILE_SCORES = np.linspace(-1.0, 2.0, 121)
"""Scores of single jobs at which the performance profile is given."""


@dataclass(frozen=True)
class Scores:
    """How contenders compare: a ``table`` of a comparison and what is worth 0 and 1 in it."""

    table: pa.Table

    def jobs(self, name: str, column: str = "job_return") -> dict[int, Array]:
        """One column of a contender: values (seeds,) by machine."""
        rows = self.table.filter(pa.compute.equal(self.table["contender"], name))
        found: dict[int, list[float]] = {}
        for machine, value in zip(rows["machine"].to_pylist(), rows[column].to_pylist(), strict=True):
            found.setdefault(machine, []).append(value)
        if not found:
            raise ParameterError(f"the comparison has no jobs of {name!r}")
        return {machine: np.array(values) for machine, values in found.items()}

    def paired(self, *names: str, column: str = "job_return") -> Array:
        """A column of contenders, mean over seeds, on the machines that all have played, (names, machines)."""
        found = [self.jobs(name, column) for name in names]
        common = sorted(set.intersection(*(set(jobs) for jobs in found)))
        return np.array([[jobs[machine].mean() for machine in common] for jobs in found])

    def against(self, name: str, other: str) -> dict[str, Any] | None:
        """Return less that of another: mean, interval, and share of the machines that lose more than ``MADE_WORSE``."""
        if other not in self.table["contender"].to_pylist():
            return None
        mine, theirs = self.paired(name, other)
        return paired_difference(mine, theirs, MADE_WORSE)

    def summary(self) -> dict[str, dict[str, Any]]:
        """What each contender achieved, as plain values, best score last.

        Raises
        ------
        ParameterError
            If following the demand or the own map has not been played, or that map earns no more than following.
        """
        names = list(dict.fromkeys(self.table["contender"].to_pylist()))
        rows = {name: self.row(name) for name in names}
        return dict(sorted(rows.items(), key=lambda item: item[1]["score"]))

    def row(self, name: str) -> dict[str, Any]:
        """What one contender achieved, as plain values; raises as ``summary``.

        ``life`` is the geometric mean over machines of the joint's life over that of following the demand, ``load`` the
        ratio of the constant forces of equal life, and ``made_worse`` the share of the machines whose return is below
        that of following by more than ``MADE_WORSE``. ``equivalent_force_N`` is a geometric mean too, None
        for a file of an earlier version. ``against_back_off`` compares with backing off; it is None
        where that has not played.
        """
        mine, zero, one = self.paired(name, ZERO, ONE)
        if not one.mean() > zero.mean():
            raise ParameterError(
                f"there is no score: on these machines {ONE!r} earns {one.mean():.2f}, not more than {ZERO!r} with "
                f"{zero.mean():.2f}; let more machines play, or widen the range of speed"
            )

        def score(drawn: NDArray[np.int64]) -> Array:
            gained = mine[drawn].mean(axis=-1) - zero[drawn].mean(axis=-1)
            scale = one[drawn].mean(axis=-1) - zero[drawn].mean(axis=-1)
            return np.asarray(np.divide(gained, scale, out=np.full_like(scale, np.nan), where=scale != 0.0))

        worn, usual = self.paired(name, ZERO, column="damage")
        lived = (worn > 0.0) & (usual > 0.0)
        life = np.exp(np.mean(np.log(usual[lived] / worn[lived]))) if lived.any() else 1.0
        every = np.arange(len(mine))
        rows = self.table.filter(pa.compute.equal(self.table["contender"], name))
        single = (mine - zero) / (one.mean() - zero.mean())
        return {
            "knows": rows["knows"][0].as_py(),
            "seeds": len(set(rows["seed"].to_pylist())),
            "machines": len(mine),
            "return": float(mine.mean()),
            "score": float(score(every)),
            "score_interval": bootstrap_interval(len(mine), score).tolist(),
            "type_iii": float(np.mean(rows["type_iii"].to_numpy())),
            "deviation": float(np.mean(rows["deviation"].to_numpy())),
            "damage": float(np.mean(rows["damage"].to_numpy())),
            "life": float(life),
            "load": float(life ** (-1.0 / LIFE_EXPONENT)),
            "equivalent_force_N": _geometric_mean(rows, "equivalent_force"),
            "made_worse": float(np.mean(mine < zero - MADE_WORSE)),
            "against_back_off": self.against(name, SAFE),
            "largest_force": float(np.max(rows["largest_force"].to_numpy())),
            "failed": float(np.mean(rows["failed"].to_numpy())),
            "better_than_following": float(np.mean(mine > zero)),
            "profile": performance_profile(single, PROFILE_SCORES).tolist(),
        }


def _geometric_mean(rows: pa.Table, name: str) -> float | None:
    """Of the positive finite values of a column; None without any, or where jobs of an earlier version lack it."""
    if name not in rows.column_names or rows[name].null_count:
        return None
    values = rows[name].to_numpy(zero_copy_only=False).astype(float)
    known = values[np.isfinite(values) & (values > 0.0)]
    return float(np.exp(np.mean(np.log(known)))) if known.size else None


def difference(told: Mapping[str, Any] | None) -> str:
    """A paired difference with its interval, bold where it is below 0 with certainty."""
    if told is None:
        return ""
    low, high = told["interval"]
    text = f"{told['more']:+.1f} ({low:.1f} to {high:.1f})"
    return f"**{text}**" if high < 0.0 else text


def _amount(value: float | None, unit: str) -> str:
    """A value in front of a ratio; nothing where it is not known."""
    return "" if value is None else f"{value:.3g} {unit}, "


def table_lines(summary: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [
        "| contender | knows | seeds | machines | return | score | 95 % | Type III | mean deviation "
        "| largest force [N] | load | life | worse than following, than backing off "
        "| return less that of backing off |",
        "|---" * 14 + "|",
    ]
    for name, row in summary.items():
        low, high = row["score_interval"]
        worse = [row["made_worse"], *([row["against_back_off"]["made_worse"]] if row["against_back_off"] else [])]
        lines.append(
            f"| {name} | {row['knows']} | {row['seeds']} | {row['machines']} | {row['return']:.2f} "
            f"| {row['score']:.2f} | {low:.2f} to {high:.2f} | {row['type_iii']:.1%} | {row['deviation']:.2f} "
            f"| {row['largest_force']:.1f} | {_amount(row['equivalent_force_N'], 'N')}x{row['load']:.2f} "
            f"| x{row['life']:.2f} | {', '.join(f'{share:.0%}' for share in worse)} "
            f"| {difference(row['against_back_off'])} |"
        )
    return lines
