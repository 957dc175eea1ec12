"""The documentation of the machines is that of the code."""

import re
from pathlib import Path

import pytest

from chaosgym.machines import MACHINES
from chaosgym.machines.parameters import markdown_table
from thesis.scorecard.evaluation import THESIS_MACHINES, evaluate
from thesis.scorecard.firmness import firmness_of
from thesis.scorecard.observation import THOROUGH
from thesis.scorecard.page import row
from thesis.scorecard.scorecard import Scorecard
from thesis.statements import read_comparisons

DOCS = Path(__file__).parent.parent / "docs"

PACKAGED = [name for name, place in MACHINES.entry_points.items() if place.startswith("chaosgym.")]
"""Machines of the package; tests register more."""


@pytest.mark.parametrize("name", sorted(PACKAGED))
def test_parameter_table_is_current(name):
    """Values, units, provenance and sources in the page of a machine are those that ``chaosgym show`` prints."""
    page = (DOCS / f"{name}.md").read_text()
    table = re.search(rf"<!-- parameters {name} -->\n(.*?)<!-- end -->", page, re.DOTALL)
    assert table is not None
    assert table[1].strip().splitlines() == markdown_table(MACHINES[name]())


def test_scorecard_page_lists_every_statement():
    """Each comparison has its row and each statement left out its reason."""
    page = (DOCS / "development" / "scorecard.md").read_text()
    known = read_comparisons()
    cells = [line.strip("| ").split(" | ", 1) for line in page.splitlines() if line.startswith("| ")]
    statements = {cell[-1]: cell[0].split(", ") for cell in cells}
    for one in known.compared:
        assert re.search(rf"^\| {one.id} \|.*$", page, re.MULTILINE) is not None, one.id
        assert not one.reading or one.id in statements[one.reading]
    for name, reason in known.out.items():
        assert name in statements[reason]


def test_scorecard_page_shows_what_the_machines_do():
    """Rows of periodic responses and of the machines' own numbers, computed again, are those of the page."""
    page = (DOCS / "development" / "scorecard.md").read_text().splitlines()
    cheap = (
        "IBS-013",
        "IBS-016",
        "IBS-020",
        "IBS-025",
        "IBS-034",
        "IBS-046",
        "SSC-045",
        "SSC-051",
        "SSC-052",
        "SSC-053",
        "SSC-075",
        "SSC-111",
    )
    chosen = [one for one in read_comparisons().compared if one.id in cheap]
    judged = evaluate(chosen, THESIS_MACHINES, efforts=THOROUGH)
    known = {name: firmness_of(machine) for name, machine in THESIS_MACHINES.items()}
    card = Scorecard(judged, {name: one for name, one in known.items() if one})
    assert [row(card, one) for one in judged if row(card, one) not in page] == []


def test_hits_are_those_of_the_rows():
    """Totals of the page count its rows, and the README repeats the firm ones."""
    page, readme = (DOCS / "development" / "scorecard.md").read_text(), (DOCS.parent / "README.md").read_text()
    told = []
    for name, letters in (("impact-beam", "IBS"), ("slider-crank", "SSC")):
        verdicts = re.findall(rf"^\| {letters}-\d+ \|(?:[^|]*\|){{4}} (\S+) \| (?:-|\d+%) \|", page, re.MULTILINE)
        hits, counted = verdicts.count("hit"), len(verdicts) - verdicts.count("contradictory")
        section = page.split(f"## {name}\n", 1)[1].split("\n## ", 1)[0]
        assert f"The machine itself hits {hits} of {counted}." in section
        shares = [float(share) for share in re.findall(r"\| (\d+)% \|", section)]
        firm = f"{sum(share >= 50 for share in shares)} of {len(shares)}"
        assert section.startswith(f"\nFirm hits: {firm}.")
        told.append(firm)
    assert f"[firmly](docs/development/scorecard.md) hit by beam and crank: **{told[0]}, {told[1]}**" in readme


def test_files_named_in_the_documentation_exist():
    """Sources, tests and scripts that a page names lie where it says, in the repository or in the package."""
    pages = [*DOCS.rglob("*.md"), *DOCS.rglob("*.py"), *DOCS.parent.glob("*.md")]
    assert len(pages) > 50
    missing = {
        f"{page.name}: {name}"
        for page in pages
        for name in re.findall(r"[\w./-]+/[\w-]+\.(?:py|toml|md|csv|png)\b", page.read_text(encoding="utf-8"))
        for bases in [(page.parent, DOCS.parent, DOCS.parent / "src" / "chaosgym")]
        if any((base / name.split("/")[0]).exists() for base in bases)  # else a reader's own folder
        and not any((base / name).exists() for base in bases)
    }
    assert missing == set()


def test_cards_of_shipped_policies_say_what_the_pages_say():
    """A score with its interval that a policy's card states stands in the documentation too, and no other."""
    pages = " ".join(Path("docs", name).read_text(encoding="utf-8") for name in ("agents.md", "controllers.md"))
    pages = " ".join(pages.split())
    cards = list(Path("src/chaosgym/control/policies/shipped").glob("*/card.md"))
    assert len(cards) == 5
    for card in cards:
        text = " ".join(card.read_text(encoding="utf-8").replace("95 % over machines ", "").split())
        for score in re.findall(r"\d\.\d\d \(-?\d\.\d\d to \d\.\d\d\)", text):
            low, high = re.findall(r"\((.*) to (.*)\)", score)[0]
            assert score in pages or f"{score.split()[0]} | {low} to {high}" in pages, (card.parent.name, score)


def test_the_paper_has_what_the_journal_asks_for():
    """Sections, length, references that resolve both ways, and no number of a result that the README does not have."""
    paper, books = ((DOCS / "paper" / name).read_text(encoding="utf-8") for name in ("paper.md", "paper.bib"))
    sections = re.findall("^# (.+)$", paper, re.MULTILINE)
    wanted = ("Summary", "Statement of need", "State of the field", "Software design", "Research impact statement")
    assert sections == [*wanted, "Acknowledgements", "References"]
    body = paper.split("---", 2)[2]
    assert 750 <= len(body.split()) <= 1750
    assert set(re.findall(r"@([a-z]+\d{4})", body)) == set(re.findall(r"^@\w+\{(\w+),", books, re.MULTILINE))
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    results = body.partition("# Research impact statement")[2].partition("# Acknowledgements")[0]
    numbers = set(re.findall(r"(?<![\w@])\d[\d.,]*(?: %| µs| of \d+)?", results))
    assert len(numbers) > 8
    assert [number for number in numbers if number.strip(".,") not in readme] == []
