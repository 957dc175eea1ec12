"""The documentation of the machines is that of the code."""

import re
from pathlib import Path

import pytest

from chaosgym.machines import MACHINES
from chaosgym.machines.parameters import markdown_table
from chaosgym.reference import read_comparisons

DOCS = Path(__file__).parent.parent / "docs"


@pytest.mark.parametrize("name", sorted(MACHINES))
def test_parameter_table_is_current(name):
    """Values, units, provenance and sources in the page of a machine are those that ``chaosgym show`` prints."""
    page = (DOCS / f"{name}.md").read_text()
    table = re.search(rf"<!-- parameters {name} -->\n(.*?)<!-- end -->", page, re.DOTALL)
    assert table is not None
    assert table[1].strip().splitlines() == markdown_table(MACHINES[name]())


def test_scorecard_page_lists_every_statement():
    """Each comparison has its row and each statement left out its reason."""
    page = (DOCS / "scorecard.md").read_text()
    compared, out = read_comparisons()
    for one in compared:
        row = re.search(rf"^\| {one.id} \|.*$", page, re.MULTILINE)
        assert row is not None, one.id
        assert f"| {'fit' if one.part == 'calibration' else 'held out'} |" in row[0]
    for name, reason in out.items():
        assert f"| {name} | {reason} |" in page
