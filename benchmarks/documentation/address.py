"""Write the repository's address wherever one belongs: the package, the citation, the site, the recipe, and badges.

python -m benchmarks.documentation.address https://github.com/OWNER/NAME

No file states an address until this was run. Run again, another address takes the place of the former one. The site is
that of `.github/workflows/docs.yml`, on GitHub's pages. It has no `repo_url`, for which its theme would ask GitHub.
"""

import re
import sys
from functools import partial
from pathlib import Path
from typing import NamedTuple

from chaosgym.files import write_atomically

ROOT = Path(__file__).parents[2]

ADDRESS = re.compile(r"https://github\.com/([\w.-]+)/([\w.-]+?)(?:\.git)?/?")


class Place(NamedTuple):
    """Lines of a file that follow others, with {address} and {site} in them, and what they were when last written."""

    file: str
    after: str
    lines: str
    former: str


PLACES = (
    Place(
        "pyproject.toml",
        'dynamic = ["version"]\n',
        'urls = {{ Repository = "{address}", Issues = "{address}/issues", Documentation = "{site}" }}\n',
        r"^urls = .*\n",
    ),
    Place(
        "CITATION.cff",
        "license: MIT\n",
        'repository-code: "{address}"\nurl: "{site}"\n',
        r"^(repository-code|url): .*\n",
    ),
    Place("mkdocs.yml", "site_name: chaosgym\n", "site_url: {site}\n", r"^site_url: .*\n"),
    Place(".ci/conda/meta.yaml", "about:\n", "  home: {address}\n  doc_url: {site}\n", r"^  (home|doc_url): .*\n"),
    Place(
        "README.md",
        "# chaosgym\n",
        "\n[![tests]({address}/actions/workflows/test.yml/badge.svg)]({address}/actions/workflows/test.yml)\n"
        "[![docs]({address}/actions/workflows/docs.yml/badge.svg)]({site})\n"
        "[![release](https://img.shields.io/pypi/v/chaosgym)](https://pypi.org/project/chaosgym/)\n",
        r"\n\[!\[tests\].*\n\[!\[docs\].*\n\[!\[release\].*\n",
    ),
)


def write_address(address: str, root: Path = ROOT) -> None:
    """Write an address into every file below a folder.

    Raises
    ------
    ValueError
        If it is no address of a repository, or a file has lost the line that it follows; names it.
    """
    found = ADDRESS.fullmatch(address)
    if found is None:
        raise ValueError(f"{address} is no address of a repository; allowed: https://github.com/OWNER/NAME")
    owner, name = found.groups()
    stated = {"address": f"https://github.com/{owner}/{name}", "site": f"https://{owner.lower()}.github.io/{name}/"}
    texts = {}
    for place in PLACES:
        text = re.sub(place.former, "", (root / place.file).read_text(encoding="utf-8"), flags=re.MULTILINE)
        if text.count(place.after) != 1:
            raise ValueError(f"{place.file} has no single line {place.after.strip()!r}, which the address follows")
        texts[root / place.file] = text.replace(place.after, place.after + place.lines.format(**stated))
    for path, text in texts.items():
        write_atomically(path, partial(Path.write_text, data=text, encoding="utf-8"))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    try:
        write_address(sys.argv[1])
    except ValueError as error:
        sys.exit(f"Error: {error}")
