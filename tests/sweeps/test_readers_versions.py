"""A dataset is read by the lowest pyarrow that is admitted, and by one that once could not read it."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from chaosgym.sweeps import read_sweep
from tests.sweeps.test_readers import PLAN, run_sweep

ROOT = Path(__file__).parents[2]
SHIPPED = [ROOT / "datasets" / machine / "sample" for machine in ("impact-beam", "slider-crank")]

READ = """
import json, sys, pyarrow, pyarrow.parquet as pq
told = {"pyarrow": pyarrow.__version__, "rows": []}
for file in sys.argv[1:]:
    table = pq.read_table(file, page_checksum_verification=True)
    signals = table.column("settled_peak_force")
    kept = signals.drop_null()
    told["rows"].append([table.num_rows, signals.null_count, len(kept[0]), kept[0][5].as_py()])
print(json.dumps(told))
"""


def lowest_admitted():
    """The lowest pyarrow of pyproject.toml."""
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    (bound,) = [line for line in wanted if line.startswith("pyarrow")]
    return re.fullmatch(r"pyarrow>=(\d+)", bound)[1] + ".0.0"


def _expected(folder):
    table = read_sweep(folder).table
    signals = table.column("settled_peak_force")
    kept = signals.drop_null()
    return [table.num_rows, signals.null_count, 64, kept[0][5].as_py()]


def test_no_column_is_a_list_of_fixed_size():
    """Readers before pyarrow 26 fail on such lists among which there are nulls."""
    for folder in SHIPPED:
        for field in pq.read_schema(folder / "sweep.parquet"):
            assert not pa.types.is_fixed_size_list(field.type), field.name


@pytest.mark.slow
@pytest.mark.parametrize("version", [lowest_admitted(), "25.0.0"])
def test_other_versions_read_every_value(version, tmp_path):
    """Both shipped samples, and a sweep made here, without half of the signals: nulls, and a value in the middle."""
    run_sweep(PLAN, tmp_path / "halves")
    folders = [*SHIPPED, tmp_path / "halves"]
    assert 0 < _expected(folders[-1])[1] < len(PLAN)
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "other")], check=True)
    python = tmp_path / "other" / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "-q", f"pyarrow=={version}", "numpy"]
    installed = subprocess.run(pip, capture_output=True, text=True, check=False)
    if installed.returncode != 0:
        pytest.skip(f"pyarrow {version} can't be installed here: {installed.stderr[-200:]}")
    files = [str(folder / "sweep.parquet") for folder in folders]
    told = subprocess.run([str(python), "-c", READ, *files], capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    assert json.loads(told.stdout) == {"pyarrow": version, "rows": [_expected(folder) for folder in folders]}
