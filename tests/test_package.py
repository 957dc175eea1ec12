"""The package as a user installs it."""

import ast
import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent


def _python(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_import_is_light():
    """Importing chaosgym loads neither gymnasium nor numpy, numba, scipy, matplotlib or torch."""
    heavy = ("gymnasium", "numpy", "numba", "scipy", "matplotlib", "torch")
    loaded = _python(f"import sys, chaosgym; print([name for name in {heavy} if name in sys.modules])")
    assert loaded == "[]"


def test_simulating_imports_few_modules():
    """The simplest command loads what it needs: not the other machine, nor diagnosis, sweeps, learning or plotting."""
    loaded = _modules_of("simulate", "impact-beam")
    own = [name for name in loaded if name.partition(".")[0] == "chaosgym"]
    wings = ("series", "recordings", "diagnosis", "branches", "sweeps", "classifier", "envs", "plotting")
    assert not [name for name in own if name.split(".")[1:2] and name.split(".")[1] in wings]
    assert "chaosgym.machines.slider_crank" not in own
    assert len(own) <= 54


def _modules_of(*arguments):
    """Modules that a command has loaded in the end."""
    code = (
        "import sys; from chaosgym.cli import app\n"
        f"try: app({[*arguments]!r}, standalone_mode=False)\n"
        "finally: print(); print(' '.join(sys.modules))"
    )
    return _python(code).splitlines()[-1].split()


def test_judging_a_recording_loads_no_machine_and_no_compiler():
    """What reads and judges a CSV, and no more: 46 modules of chaosgym at the most."""
    loaded = _modules_of("judge", str(ROOT / "docs/data/peaks.csv"), "--column", "upper")
    own = [name for name in loaded if name.partition(".")[0] == "chaosgym"]
    assert "chaosgym.recordings.judge" in own
    assert len(own) <= 46
    assert {"numba", "gymnasium", "matplotlib", "chaosgym.core", "chaosgym.machines"}.isdisjoint(loaded)


@pytest.mark.parametrize("command", ["judge", "judge-sweep", "run-up", "monitor"])
def test_help_of_a_command_without_machine_imports_none(command):
    """Options of machines are built where a machine is named."""
    loaded = _modules_of(command, "--help")
    assert [name for name in loaded if name.startswith(("chaosgym.machines", "chaosgym.core", "numba"))] == []


def test_help_of_a_command_imports_no_machine_that_is_not_named():
    """The names are in the registry; the options are those of the machine on the line."""
    assert "chaosgym.machines.machine" not in _modules_of("diagnose", "--help")
    loaded = _modules_of("diagnose", "impact-beam", "--help")
    assert "chaosgym.machines.impact_beam" in loaded
    assert "chaosgym.machines.slider_crank" not in loaded


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


def _asks_what_machine(node, kinds, names):
    """True for a type check against a machine's class, and for a table or a comparison by a machine's name."""
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "issubclass"):
        return any(getattr(part, "id", getattr(part, "attr", "")) in kinds for part in ast.walk(node.args[1]))
    asked = []
    if isinstance(node, ast.Dict):
        asked = node.keys
    elif isinstance(node, ast.Compare):
        asked = [node.left, *node.comparators]
    elif isinstance(node, ast.MatchValue | ast.Subscript):
        asked = [getattr(node, "value", None), getattr(node, "slice", None)]
    if isinstance(node, ast.MatchClass):
        return getattr(node.cls, "id", "") in kinds
    return any(isinstance(part, ast.Constant) and part.value in names for part in asked)


def _above_machines():
    """Syntax trees of the modules on the floors above the machines, by their path."""
    package = ROOT / "src/chaosgym"
    for path in sorted(package.rglob("*.py")):
        if path.relative_to(package).parts[0] not in ("core", "machines"):
            yield path, ast.parse(path.read_text(encoding="utf-8"))


def test_no_floor_above_the_machines_asks_which_machine_it_has():
    """A machine is a folder and a line: above ``machines`` there is no type check and no table by a machine's name."""
    from chaosgym.machines import MACHINES, Machine
    from chaosgym.machines.modal_machine import ModalMachine

    kinds, left = {ModalMachine.__name__}, [MACHINES[name] for name in MACHINES]
    while left:
        kind = left.pop()
        if kind is not Machine and issubclass(kind, Machine):
            kinds.add(kind.__name__)
            left.extend(kind.__bases__)
    guilty = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path, tree in _above_machines()
        for node in ast.walk(tree)
        if _asks_what_machine(node, kinds, set(MACHINES))
    ]
    assert guilty == []


def test_no_floor_above_the_machines_reaches_into_the_folder_of_one():
    """What a floor needs is in the protocol; the folder of one is open to public names alone."""
    folders = tuple(
        f"chaosgym.machines.{path.parent.name}." for path in (ROOT / "src/chaosgym/machines").glob("*/__init__.py")
    )
    guilty = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path, tree in _above_machines()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith(folders)
    ]
    assert {place.partition(":")[0] for place in guilty} == {"src/chaosgym/__init__.py"}


def test_compiled_kernels_are_cached_by_their_sources():
    """An edit in any kernel source changes the cache folder, so that stale machine code is never served."""
    from chaosgym.core.joints.cycle import advance_joints
    from chaosgym.core.kernel_cache import KERNEL_CACHE, kernel_digest

    assert Path(KERNEL_CACHE).name == kernel_digest()
    assert Path(advance_joints.stats.cache_path) == Path(KERNEL_CACHE, "joints")


def test_every_kernel_takes_its_decorator_from_one_place():
    """``core.kernel`` tells numba where to cache; numba's own ``njit`` would cache by the place of the sources."""
    sources = [path for path in (ROOT / "src/chaosgym").rglob("*.py") if path.name != "kernel.py"]
    guilty = [path for path in sources if re.search(r"^from numba import .*\bnjit\b", path.read_text(), re.MULTILINE)]
    assert guilty == []


@pytest.mark.parametrize("words", ["info", "--help", "show --help"])
def test_commands_without_kernels_do_not_import_numba(words):
    """What computes no machine does not wait for the compiler."""
    program = "import sys; from chaosgym.cli import app; app(sys.argv[1:], standalone_mode=False)"
    told = [sys.executable, "-c", f"import atexit, sys; atexit.register(lambda: print(*sys.modules)); {program}"]
    found = subprocess.run([*told, *words.split()], check=True, capture_output=True, text=True).stdout
    loaded = found.splitlines()[-1].split()
    assert "chaosgym.cli" in loaded
    assert "numba" not in loaded


def test_kernels_of_the_classifier_are_cached_by_their_content():
    """The same holds for the classifier's kernels, in a folder beside that of the core."""
    from chaosgym.classifier.kernels.trees import walk_rows
    from chaosgym.core.kernel_cache import KERNEL_CACHE, kernel_digest

    folder = Path(KERNEL_CACHE).with_name(kernel_digest(ROOT / "src/chaosgym/classifier/kernels"))
    assert Path(walk_rows.stats.cache_path).is_relative_to(folder)


def test_editing_a_kernel_source_changes_the_digest(tmp_path):
    """The digest depends on every byte of every source."""
    from chaosgym.core.kernel_cache import source_digest

    (tmp_path / "a.py").write_text("x = 1\n")
    before = source_digest(tmp_path)
    (tmp_path / "a.py").write_text("x = 2\n")
    assert source_digest(tmp_path) != before


def _collect_from(source, folder):
    """Every test file of the source archive finds what it imports there, as a packager's build does."""
    with tarfile.open(source) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (root,) = (folder / "unpacked").iterdir()
    collect = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "-m", ""]
    subprocess.run(collect, cwd=root, env={**os.environ, "PYTHONPATH": str(root / "src")}, check=True)


@pytest.mark.slow
def test_the_wheel_alone_classifies_simulates_and_plays(folder, tmp_path, monkeypatch):
    """Wheel and source pass ``twine check``; in a fresh environment, without torch, the wheel's commands work.

    Policies, a made-up one and the shipped one, are played, and a job is drawn.
    """
    monkeypatch.delenv("PYTHONPATH", raising=False)
    # from the clone, whose kernels were compiled when it was installed
    for kind in ("--sdist", "--wheel"):
        subprocess.run([sys.executable, "-m", "build", kind, "--outdir", str(tmp_path), str(ROOT)], check=True)
    (wheel,), (source,) = tmp_path.glob("chaosgym-*.whl"), tmp_path.glob("chaosgym-*.tar.gz")
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", str(wheel), str(source)], check=True)
    _collect_from(source, tmp_path)
    names = zipfile.ZipFile(wheel).namelist()
    assert "chaosgym/py.typed" in names
    weights = ("impact-beam", "slider-crank", "impact-beam-sense")
    assert {f"chaosgym/weights/{name}.npz" for name in weights} <= set(names)
    assert not [name for name in names if name.startswith(("tests", "agents"))]
    assert "chaosgym/compiled/made-for.txt" in names
    assert "none-any" not in wheel.name
    venv.create(tmp_path / "env", with_pip=True)
    tools = tmp_path / "env" / "bin"
    subprocess.run([tools / "pip", "install", "--quiet", str(wheel)], check=True)
    assert list((tmp_path / "env").rglob("site-packages/numba"))
    assert not list((tmp_path / "env").rglob("site-packages/torch"))

    def told(*words):
        command = [str(tools / "chaosgym"), *map(str, words), "--json"]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path, env=environment)
        assert "compiling" not in done.stderr, "machine code comes with the wheel"
        return json.loads(done.stdout)

    beam = ("impact-beam", "--frequency-hz", "30", "--clearance-mm", "0.127")
    assert told("classify", *beam)["response_type"]
    assert told("simulate", *beam)["peak_force_N"]
    played = told("run-agent", "chaosgym/ImpactBeam-v1", "--policy", folder, "--out", "job.gif")
    assert played["status"] == "job_done"
    assert (tmp_path / "job.gif").stat().st_size > 10_000
    assert told("run-agent", "chaosgym/ImpactBeamTolerance-v1")["status"] == "job_done"


def test_version_is_said_once():
    """The citation and the latest section of the changelog name the package's version."""
    import chaosgym

    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {chaosgym.__version__}\n" in citation
    latest = next(
        line for line in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines() if line[:3] == "## "
    )
    assert latest.split()[1] in (chaosgym.__version__, "Unreleased")


def test_the_conda_recipe_has_the_packages_dependencies():
    """The recipe's requirements, hash apart, are those of ``pyproject.toml``, and its version is the package's."""
    import chaosgym

    recipe = (ROOT / ".ci/conda/meta.yaml").read_text(encoding="utf-8")
    assert f'{{% set version = "{chaosgym.__version__}" %}}' in recipe
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {re.sub(r"^matplotlib(?=\W)", "matplotlib-base", one) for one in project["dependencies"]}
    section = recipe.partition("  run:\n")[2].partition("\n\n")[0]
    stated = {line.strip(" -").replace(" ", "") for line in section.splitlines()}
    assert stated == wanted | {f"python{project['requires-python']}"}
    assert "noarch: python" in recipe
    assert "CHAOSGYM_KERNELS=none" in recipe, "machine code is for one platform"


@pytest.fixture
def workflows():
    """Workflows of continuous integration by name."""
    folder = ROOT / ".github/workflows"
    if not folder.is_dir():
        pytest.skip("the source archive holds no workflows")
    return {path.stem: yaml.safe_load(path.read_text(encoding="utf-8")) for path in folder.glob("*.yml")}


def test_a_release_uploads_no_wheel_that_an_index_refuses(workflows):
    """An index takes no wheel of plain Linux; who has another platform needs the one without machine code."""
    steps = "".join(step.get("run", "") for step in workflows["release"]["jobs"]["build"]["steps"])
    assert "--remove --platform-tag manylinux" in steps
    assert "CHAOSGYM_KERNELS=none python -m build --wheel" in steps


def test_workflows_may_read_only_and_name_versions_of_actions(workflows):
    """A token that may write is asked for by the job that needs it."""
    jobs = [job for workflow in workflows.values() for job in workflow["jobs"].values()]
    assert all(workflow["permissions"]["contents"] == "read" for workflow in workflows.values())
    used = [step["uses"] for job in jobs for step in job["steps"] if "uses" in step]
    assert [name for name in used if not re.search(r"@(v\d+|release/v\d+|[0-9a-f]{40})$", name)] == []


def test_the_versions_of_python_that_are_tried_are_those_that_are_promised(workflows):
    """Those of the classifiers; the lowest is that of ``requires-python`` and of the installation page."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    tried = workflows["test"]["jobs"]["test"]["strategy"]["matrix"]["python"]
    assert [f"Programming Language :: Python :: {one}" for one in tried] == [
        line for line in project["classifiers"] if line.startswith("Programming Language :: Python :: 3.")
    ]
    assert project["requires-python"] == f">={tried[0]}"
    assert f"Python {tried[0]} or newer" in (ROOT / "docs/how-to/install.md").read_text(encoding="utf-8")
    systems = workflows["test"]["jobs"]["platforms"]["strategy"]["matrix"]["os"]
    assert systems == ["windows-latest", "macos-latest"]
