"""Examples of the documentation of Python: every public name has one, and each gives what it shows."""

import doctest
import importlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import chaosgym

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs" / "api").glob("*.md"))
MODULES = sorted(
    ".".join(file.relative_to(ROOT / "src").with_suffix("").parts).removesuffix(".__init__")
    for file in (ROOT / "src").rglob("*.py")
    if ">>>" in file.read_text(encoding="utf-8")
)
CONSTANTS = {"THESIS_SLIDER_CRANK", "__version__"}
OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def _found(path: str) -> object:
    """Return what a page names: a module, or something in one."""
    try:
        return importlib.import_module(path)
    except ModuleNotFoundError:
        home, name = path.rsplit(".", 1)
        return getattr(_found(home), name)


def _functions() -> dict[str, object]:
    """Functions of the pages of the API, by name."""
    named = {path: _found(path) for page in PAGES for path in re.findall(r"^::: (\S+)", page.read_text("utf-8"), re.M)}
    for path, found in list(named.items()):
        if inspect.ismodule(found):
            within = inspect.getmembers(found, inspect.isfunction)
            named |= {f"{path}.{name}": one for name, one in within if one.__module__ == path and name[0] != "_"}
    return {path: one for path, one in named.items() if inspect.isfunction(one)}


def test_every_public_name_has_an_example():
    """Whoever looks up a name of ``chaosgym``, or a function of the reference, finds how it is called."""
    public = {f"chaosgym.{name}": getattr(chaosgym, name) for name in set(chaosgym.__all__) - CONSTANTS}
    without = [path for path, one in {**public, **_functions()}.items() if ">>>" not in (inspect.getdoc(one) or "")]
    assert without == []


@pytest.mark.parametrize("module", MODULES)
def test_examples_give_what_they_show(module, monkeypatch):
    """What an example prints is what its docstring shows."""
    monkeypatch.chdir(ROOT)
    names = {"chaosgym": chaosgym, "np": np}
    result = doctest.testmod(importlib.import_module(module), extraglobs=names, optionflags=OPTIONS)
    assert result.attempted > 0
    assert result.failed == 0
