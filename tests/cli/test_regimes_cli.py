"""``chaosgym regimes``: the pools are made and checked from the command line."""

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner

from chaosgym.cli import app


def test_make_writes_tables_that_load_without_a_pickle(tmp_path: Path) -> None:
    """Two speeds of the nominal machine and one more, with everything that they depend on."""
    arguments = ["regimes", "make", "chaosgym/ImpactBeamTolerance-v0", "--spacing", "26", "--machines", "2"]
    run = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path), "--json"])
    assert run.exit_code == 0, run.output
    about = json.loads(run.stdout)
    assert about["command"] == "chaosgym regimes make chaosgym/ImpactBeamTolerance-v0 --spacing 26 --machines 2"
    with np.load(about["file"], allow_pickle=False) as kept:
        assert kept["nature"].shape == (2, 1, 2)
        assert kept["speeds"].tolist() == [4.0, 30.0]
        assert kept["nature"][0, 0].tolist() == [0, 2]


def test_check_prints_its_counts() -> None:
    """Every sampled step falls into one of four groups."""
    run = CliRunner().invoke(app, ["regimes", "check", "chaosgym/ImpactBeamTolerance-v0", "--samples", "3", "--json"])
    assert run.exit_code == 0, run.output
    found = json.loads(run.stdout)
    assert found["periodic"] + found["irregular"] + found["missed"] + found["blamed"] == found["samples"] == 3
