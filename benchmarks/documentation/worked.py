"""What does the design report say of the worked examples? Their outputs and pictures, written into the page.

python -m benchmarks.documentation.worked docs/worked-examples.md [NAME ...]
"""

import re
import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks.documentation.commands import ROOT, _run, _write

COMMAND = "chaosgym design docs/examples/{name}.toml --plot {name}.png --out {name}.html"


def shown(name: str, text: str) -> str:
    """Output of an example, as the page shows it."""
    command = re.escape(COMMAND.format(name=name))
    (output,) = re.findall(rf"```console\n\$ {command}\n(.*?)```", text, re.DOTALL)
    return str(output)


def written(name: str, text: str, output: str) -> str:
    """The page with the output of an example."""
    head = f"```console\n$ {COMMAND.format(name=name)}\n"
    return text.replace(f"{head}{shown(name, text)}```", f"{head}{output}```")


def run(name: str, place: Path, options: str = "") -> str:
    """Run an example in an empty folder, and return what it prints."""
    (place / "docs").mkdir()
    for source in ("docs/machines", "docs/examples"):
        (place / source).symlink_to(ROOT / source)
    return _run(f"{COMMAND.format(name=name)}{options}", place)


def main(page: Path, names: list[str]) -> None:
    """Run some examples, or all, and write page and pictures."""
    for name in names or sorted(path.stem for path in (ROOT / "docs" / "examples").glob("*.toml")):
        with tempfile.TemporaryDirectory() as folder:
            output = run(name, Path(folder))
            shutil.copyfile(Path(folder) / f"{name}.png", page.parent / "examples" / f"{name}.png")
        _write(page, written(name, page.read_text(encoding="utf-8"), output))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
