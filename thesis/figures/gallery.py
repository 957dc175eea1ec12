"""The gallery: a page with what agrees with the print and what does not."""

from collections.abc import Sequence
from pathlib import Path

from chaosgym.files import write_atomically
from thesis.figures.figure import Finding
from thesis.figures.printed import contradiction
from thesis.figures.produce import Drawn, picture_path
from thesis.figures.registry import FIGURES

_WORDS = {True: "agrees", False: "**differs**", None: "not decided"}


def verdict(finding: Finding) -> str:
    """Whether a statement is met, in words; one that the text contradicts is not judged."""
    against = contradiction(finding.targets)
    return f"contradictory: {against}" if against else _WORDS[finding.agrees]


_OPENING = """# The simulated figures of the thesis, drawn again

Written by `python -m thesis figures all --out FOLDER --gallery docs/development/figures.md`; `--list` tells what
each figure shows. What the text prints of a figure is drawn over it in one colour. Names of statements are rows of
the [scorecard](scorecard.md), judged by the same runs. Dots within 0.5 N count as one.
"""


def totals(drawn: Sequence[Drawn]) -> dict[str, int]:
    """How many statements agree, and how many do not; what the text contradicts, or does not decide, is not judged."""
    found = [finding for one in drawn for finding in one.findings]
    judged = [finding.agrees for finding in found if not contradiction(finding.targets)]
    return {
        "agree": judged.count(True),
        "differ": judged.count(False),
        "contradictory": len(found) - len(judged),
        "undecided": judged.count(None),
    }


def sensitivities(drawn: Sequence[Drawn]) -> dict[str, list[tuple[str, Finding]]]:
    """Statements about sensitivity by parameter, each with its figure; one that two figures share stands once."""
    found: dict[str, list[tuple[str, Finding]]] = {}
    for one in drawn:
        for finding in one.findings:
            known = [other for _, other in found.get(finding.sensitivity, [])]
            if finding.sensitivity and finding not in known:
                found.setdefault(finding.sensitivity, []).append((one.figure.id, finding))
    return found


def gallery(drawn: Sequence[Drawn], pictures: Path) -> str:
    """The page; pictures that lie in the folder ``pictures`` beside it are shown."""
    count = totals(drawn)
    lines = [
        _OPENING,
        f"Of {count['agree'] + count['differ']} printed statements about these figures {count['agree']} agree and "
        f"{count['differ']} differ.",
    ]
    shown = {one.figure.id for one in drawn}
    missing = [number for number in FIGURES if number not in shown]
    if missing:
        lines.append(f"Not drawn for this page: {', '.join(missing)}.")
    answered = sensitivities(drawn)
    if answered:
        lines += [
            "",
            "## Sensitivities",
            "",
            "| parameter | figures | agree | differ |",
            "|---|---|---|---|",
        ]
    lines += [_sensitivity(parameter, entries) for parameter, entries in answered.items()]
    for place, one in enumerate(drawn):
        figure = one.figure
        lines += ["", f"## {figure.label}. {figure.title}"]
        if figure.remark:
            lines += ["", f"Not as in the thesis: {figure.remark}."]
        if one.error:
            lines += ["", f"Not computed: {one.error}"]
        same = [other.figure.id for other in drawn[:place] if one.findings and other.findings == one.findings]
        if same:
            lines += ["", f"Statements: those of figure {same[0]}."]
        elif one.findings:
            lines += ["", *_statements(one.findings)]
        picture = picture_path(figure, pictures)
        if picture.exists():
            lines += ["", f"![{figure.label}]({pictures.name}/{picture.name})"]
    return "\n".join(lines) + "\n"


def _statements(findings: Sequence[Finding]) -> list[str]:
    """Lines on statements: those that a row of the scorecard tells in full by their names, the others in words."""
    rows: dict[str, list[str]] = {}
    lines = []
    for finding in findings:
        if finding.scored:
            word = "not judged" if contradiction(finding.targets) else _WORDS[finding.agrees]
            rows.setdefault(word, []).extend(finding.targets)
        else:
            lines.append(f"- {finding.printed}. Here {finding.here}: {verdict(finding)}.")
    return [*(f"- {word}: {', '.join(dict.fromkeys(names))}" for word, names in rows.items()), *lines]


def _sensitivity(parameter: str, entries: Sequence[tuple[str, Finding]]) -> str:
    """Row of a parameter: the figures that vary it, and what became of their statements about it."""
    figures = ", ".join(dict.fromkeys(number for number, _ in entries))
    judged = [finding.agrees for _, finding in entries if not contradiction(finding.targets)]
    return f"| {parameter} | {figures} | {judged.count(True)} | {judged.count(False)} |"


def write_gallery(drawn: Sequence[Drawn], path: Path) -> None:
    """Write the page; pictures in ``figures`` beside it are shown."""
    path.parent.mkdir(parents=True, exist_ok=True)
    page = gallery(drawn, path.parent / "figures")
    write_atomically(path, lambda temporary: temporary.write_text(page, encoding="utf-8"))
