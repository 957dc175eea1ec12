"""The pages of the environments are what their classes say."""

from pathlib import Path

from benchmarks.envs.documentation import pages
from chaosgym.envs import ENVIRONMENTS

DOCS = Path(__file__).parents[2] / "docs"


def test_the_pages_are_the_docstrings() -> None:
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
    """Machines are drawn from the training pool, and wear, where the id says so."""
    written = dict(pages())
    for name, pool, wear in (("", "nominal", False), ("Tolerance", "training", False), ("Wear", "training", True)):
        page = written[f"environments/SliderCrank{name}-v0.md"]
        assert f"| `{pool}` " in next(line for line in page.splitlines() if line.startswith("| `pool`"))
        assert f"| `{wear}` " in next(line for line in page.splitlines() if line.startswith("| `wear`"))
