"""The documentation site builds without a warning, and holds what it promises."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import chaosgym

ROOT = Path(__file__).parent.parent

LOADED = {("img", "src"), ("script", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}
"""What a browser fetches without being asked."""


class Page(HTMLParser):
    """Links of a page as (tag, attribute, address), and the anchors that it holds."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        """Keep what a tag links to and what it is called."""
        given = dict(attrs)
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        self.links += [(tag, name, given[name]) for name in ("href", "src") if given.get(name) is not None]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built with every warning as an error; its pages by path."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return {path.resolve(): Page(path) for path in folder.rglob("*.html") if path.name != "404.html"}


def test_every_internal_link_leads_somewhere(site):
    """Addresses without a host name a file of the site, and fragments an anchor of that page."""
    broken = []
    for path, page in site.items():
        for _, _, address in page.links:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.is_file():
                broken.append(f"{path.name}: {address}")
            elif parts.fragment and target in site and unquote(parts.fragment) not in site[target].anchors:
                broken.append(f"{path.name}: no anchor {address}")
    assert len(site) > 40
    assert broken == []


def test_no_page_asks_another_host(site):
    """Pictures, scripts and styles lie in the site itself."""
    foreign = {
        address
        for page in site.values()
        for tag, name, address in page.links
        if (tag, name) in LOADED and urlsplit(address).netloc
    }
    assert foreign == set()


def test_every_public_name_has_its_entry(site):
    """The reference shows each name of ``chaosgym.__all__``, but the version and the constants."""
    anchors = {anchor.rpartition(".")[2] for page in site.values() for anchor in page.anchors}
    assert set(chaosgym.__all__) - anchors <= {"__version__", "THESIS_SLIDER_CRANK"}


def test_pages_of_commands_say_what_commands_say():
    """Each command has a page with its present summary, options and examples, and the list names it."""
    code = (
        "from benchmarks.documentation.commands import *\n"
        "folder = ROOT / 'docs/commands'\n"
        "assert (folder / 'index.md').read_text('utf-8') == index(), 'index'\n"
        "for name in COMMANDS:\n"
        "    text = (folder / f'{name}.md').read_text('utf-8')\n"
        "    assert text == renewed(name, text), name\n"
        "    for example in EXAMPLES.get(name, []):\n"
        "        assert '$ ' + example['run'] in text, (name, example)\n"
    )
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    hint = "python -m benchmarks.documentation.commands docs/commands --options"
    assert done.returncode == 0, f"run: {hint}\n{done.stderr}"


def words(text):
    """A text without numbers, bars and the worst surface: in chaos these hang on the last digit of a processor."""
    text = re.sub(r"(worst surface:) (upper|lower)", r"\1", text)
    return " ".join(re.sub(r"[-+]?\d[\d.,e+-]*|#", " # ", text).replace("# ", "").split())


@pytest.mark.slow
def test_commands_print_what_their_pages_show(tmp_path):
    """Examples without times or versions print today, word for word, what their page shows."""
    from benchmarks.documentation.commands import EXAMPLES, outputs_of

    differing = []
    for name, examples in EXAMPLES.items():
        steady = [number for number, example in enumerate(examples) if example.get("steady", True)]
        (tmp_path / name).mkdir()
        outputs = outputs_of(name, tmp_path / name, steady)
        page = (ROOT / "docs" / "commands" / f"{name}.md").read_text("utf-8")
        for number, output in zip(steady, outputs, strict=True):
            shown = page.split(f"$ {examples[number]['run']}\n")[1].split("```")[0]
            if words(output) != words(shown):
                differing.append((examples[number]["run"], output, shown))
    assert differing == []


def test_tutorials_have_pictures():
    """Each notebook shows what its script draws."""
    import nbformat

    for script in (ROOT / "docs" / "tutorials").glob("*.py"):
        outputs = [
            each for cell in nbformat.read(script.with_suffix(".ipynb"), 4).cells for each in cell.get("outputs", ())
        ]
        drawn = sum("image/png" in each.get("data", ()) for each in outputs)
        assert drawn >= script.read_text("utf-8").count("plt.show()") > 0, script


@pytest.mark.slow
@pytest.mark.parametrize("name", ["1-recording", "2-map", "3-agent", "4-trust", "5-compressor", "6-learned"])
def test_tutorials_run(name):
    """A tutorial runs from its first cell to its last, and prints what its page shows, word for word."""
    import nbformat

    from benchmarks.documentation.tutorials import executed, texts

    folder = ROOT / "docs" / "tutorials"
    shown = nbformat.read(folder / f"{name}.ipynb", as_version=4)
    found = executed(folder / f"{name}.py")
    assert [cell.source for cell in found.cells] == [cell.source for cell in shown.cells]
    assert words("\n".join(texts(found))) == words("\n".join(texts(shown)))
