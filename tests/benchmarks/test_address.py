"""The repository's address is written by one command, and stands nowhere before."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from benchmarks.documentation.address import PLACES, write_address

ROOT = Path(__file__).parents[2]


@pytest.fixture
def clone(tmp_path):
    """The files that have an address."""
    for place in PLACES:
        (tmp_path / place.file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / place.file, tmp_path / place.file)
    return tmp_path


def test_every_file_has_the_last_address_once(clone):
    """What was written for another address is gone; all files are still what they are."""
    write_address("https://github.com/former/one", clone)
    write_address("https://github.com/Second/other.git", clone)
    after = {place.file: (clone / place.file).read_text() for place in PLACES}
    assert not [name for name, text in after.items() if "former/one" in text]
    urls = tomllib.loads(after["pyproject.toml"])["project"]["urls"]
    assert urls["Repository"] == "https://github.com/Second/other"
    assert urls["Documentation"] == "https://second.github.io/other/"
    assert f'repository-code: "{urls["Repository"]}"\n' in after["CITATION.cff"]
    assert f"site_url: {urls['Documentation']}\n" in after["mkdocs.yml"]
    assert f"  home: {urls['Repository']}\n" in after[".ci/conda/meta.yaml"]
    assert after["README.md"].count("badge.svg") == 2
    assert len(after["README.md"].split()) <= 600
    write_address("https://github.com/Second/other", clone)
    assert {place.file: (clone / place.file).read_text() for place in PLACES} == after


def test_what_is_no_address_changes_nothing(clone):
    """One line says what is allowed."""
    before = [(clone / place.file).read_bytes() for place in PLACES]
    with pytest.raises(ValueError, match="allowed: https://github"):
        write_address("chaosgym", clone)
    assert [(clone / place.file).read_bytes() for place in PLACES] == before
    command = [sys.executable, "-m", "benchmarks.documentation.address", "chaosgym"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
