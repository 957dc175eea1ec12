"""The package as a user installs it."""

import json
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def _python(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_import_is_light():
    """Importing chaosgym registers the environments without loading numba, scipy, matplotlib or torch."""
    loaded = _python(
        "import sys, chaosgym; print([m for m in ('numba', 'scipy', 'matplotlib', 'torch') if m in sys.modules])"
    )
    assert loaded == "[]"


def test_classifying_needs_neither_torch_nor_scikit_learn():
    """Inference is numpy alone."""
    code = (
        "import sys, chaosgym; chaosgym.default_classifier('impact-beam').classify(chaosgym.ImpactBeam());"
        "print([m for m in ('torch', 'sklearn') if m in sys.modules])"
    )
    assert _python(code) == "[]"


def test_public_names_exist():
    """Every name in __all__ can be imported, and an unknown one is an AttributeError."""
    import chaosgym

    for name in chaosgym.__all__:
        assert getattr(chaosgym, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        chaosgym.nonsense  # noqa: B018


def test_compiled_kernels_are_cached_by_their_sources():
    """An edit in any kernel source changes the cache folder, so that stale machine code is never served."""
    from chaosgym.core import KERNEL_CACHE, source_digest

    assert Path(KERNEL_CACHE).name == source_digest(Path(ROOT / "src/chaosgym/core"))


def test_kernels_of_the_classifier_are_cached_by_their_content():
    """The same holds for the classifier's kernels, in a folder beside that of the core."""
    from chaosgym.classifier.kernels.trees import walk_rows
    from chaosgym.core import KERNEL_CACHE, source_digest

    folder = Path(KERNEL_CACHE).with_name(
        source_digest(*(ROOT / "src/chaosgym" / part for part in ("core", "classifier/kernels")))
    )
    assert Path(walk_rows.stats.cache_path).is_relative_to(folder)


def test_editing_a_kernel_source_changes_the_digest(tmp_path):
    """The digest depends on every byte of every source."""
    from chaosgym.core import source_digest

    (tmp_path / "a.py").write_text("x = 1\n")
    before = source_digest(tmp_path)
    (tmp_path / "a.py").write_text("x = 2\n")
    assert source_digest(tmp_path) != before


@pytest.mark.slow
def test_wheel_alone_classifies_and_simulates(tmp_path):
    """Wheel and source pass ``twine check``; the wheel alone, in a fresh environment, classifies and simulates."""
    subprocess.run([sys.executable, "-m", "build", "--outdir", str(tmp_path), str(ROOT)], check=True)
    (wheel,), (source,) = tmp_path.glob("chaosgym-*.whl"), tmp_path.glob("chaosgym-*.tar.gz")
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", str(wheel), str(source)], check=True)
    names = zipfile.ZipFile(wheel).namelist()
    assert "chaosgym/py.typed" in names
    assert {"chaosgym/weights/impact-beam.npz", "chaosgym/weights/slider-crank.npz"} <= set(names)
    assert not [name for name in names if name.startswith(("tests", "agents"))]
    venv.create(tmp_path / "env", with_pip=True)
    tools = tmp_path / "env" / "bin"
    subprocess.run([tools / "pip", "install", "--quiet", str(wheel)], check=True)
    for command, key in (("classify", "response_type"), ("simulate", "peak_force_N")):
        done = subprocess.run(
            [tools / "chaosgym", command, "impact-beam", "--frequency-hz", "30", "--clearance-mm", "0.127", "--json"],
            capture_output=True,
            text=True,
            check=True,
            cwd=tmp_path,
        )
        assert json.loads(done.stdout)[key]


def test_version_is_said_once():
    """The citation and the latest section of the changelog name the package's version."""
    import chaosgym

    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {chaosgym.__version__}\n" in citation
    latest = next(
        line for line in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines() if line[:3] == "## "
    )
    assert latest.split()[1] in (chaosgym.__version__, "Unreleased")
