"""The pages of the environments are what their tasks say."""

from pathlib import Path

import gymnasium as gym

from benchmarks.envs.documentation import pages
from chaosgym.envs import ENVIRONMENTS

DOCS = Path(__file__).parents[2] / "docs"


def test_the_pages_are_current() -> None:
    """Every page is what the command of docs/environments.md writes, but that of any machine; no other is there."""
    written = dict(pages())
    there = {f"environments/{one.name}" for one in DOCS.glob("environments/*")}
    assert {file for file in written if "/" in file} == there - {"environments/AnyMachine.md"}
    for file, page in written.items():
        assert (DOCS / file).read_text(encoding="utf-8") == page


def test_every_id_stands_on_its_machines_page_with_its_level() -> None:
    """A reader finds each id, on one page alone, and what its machines differ in."""
    written = [page for file, page in pages() if "/" in file]
    for name in ENVIRONMENTS:
        row = f"| `{name}` | `{gym.spec(name).kwargs['level']}` |"
        assert sum(row in page for page in written) == 1


def test_levels_say_what_is_drawn() -> None:
    """The clearance grows, and machines have tolerances, where the level says so."""
    page = dict(pages())["environments/SliderCrank.md"]
    assert "| `nominal` | none | 0% |" in page
    assert "| `clearance` | `slider_clearance` +-10 % | 0% |" in page
    assert "| `wear` | `slider_clearance` +-10 % | 10% |" in page
