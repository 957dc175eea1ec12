"""The pages of the environments are what their tasks say."""

from pathlib import Path

from benchmarks.envs.documentation import pages
from chaosgym.envs import ENVIRONMENTS

DOCS = Path(__file__).parents[2] / "docs"


def test_the_pages_are_current() -> None:
    """Every page is what the command named in docs/environments.md writes, and every environment has one."""
    written = dict(pages())
    assert len(written) == len(ENVIRONMENTS) + 1
    for file, page in written.items():
        assert (DOCS / file).read_text(encoding="utf-8") == page


def test_every_page_makes_its_own_environment() -> None:
    """The examples of a page name its id, not that of a sister."""
    for name, page in zip(ENVIRONMENTS, dict(pages()).values(), strict=False):
        assert f'gym.make("{name}")' in page
        assert page.startswith(f"# {name}\n")


def test_defaults_are_those_of_the_id() -> None:
    """The clearance grows, and machines have tolerances, where the id says so."""
    written = dict(pages())
    for name, widths, wear in (
        ("", "none", "0"),
        ("Tolerance", "`slider_clearance` +-10 %", "0"),
        ("Wear", "`s", "0.1"),
    ):
        page = written[f"environments/SliderCrank{name}-v1.md"]
        assert f"Tolerances, uniform: {widths}" in page
        assert f"| `wear` | `{wear}` " in page
