"""A comparison in words: one line of a Markdown table for each contender."""

from collections.abc import Mapping
from typing import Any


def difference(told: Mapping[str, Any] | None) -> str:
    """A paired difference with its interval, bold where it is below 0 with certainty."""
    if told is None:
        return ""
    low, high = told["interval"]
    text = f"{told['more']:+.1f} ({low:.1f} to {high:.1f})"
    return f"**{text}**" if high < 0.0 else text


def table_lines(summary: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [
        "| contender | knows | seeds | machines | return | score | 95 % | Type III | mean deviation | load | life "
        "| made worse | return less that of backing off |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, row in summary.items():
        low, high = row["score_interval"]
        lines.append(
            f"| {name} | {row['knows']} | {row['seeds']} | {row['machines']} | {row['return']:.2f} "
            f"| {row['score']:.2f} | {low:.2f} to {high:.2f} | {row['type_iii']:.1%} | {row['deviation']:.2f} "
            f"| x{row['load']:.2f} | x{row['life']:.2f} | {row['made_worse']:.0%} "
            f"| {difference(row['against_back_off'])} |"
        )
    return lines
