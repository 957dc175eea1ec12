"""The datasets of the repository can be made from what Git keeps of them, and a wrong one is noticed."""

import json
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from benchmarks.cli import app
from benchmarks.sweeps import build
from benchmarks.sweeps.build import RECIPES, Recipe, build_dataset, dataset_plan, drawn_digest, sample_of, write_sample
from chaosgym.errors import DatasetError
from chaosgym.sweeps import read_sweep, run_sweep

SHIPPED = Path(__file__).parents[2] / "datasets"

ALL = dict(RECIPES)

SMALL = Recipe(5, 3, 100, ("length=0.27:0.29", "excitation_frequency=10:30", "clearance=5e-5:2e-4:log"))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A dataset of five crosses of beams, whose sample has three, in a folder for both."""
    home = tmp_path_factory.mktemp("build")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(RECIPES, "impact-beam", SMALL)
        patch.setattr(build, "SAMPLE_CROSSES", 3)
        write_sample(build_dataset("impact-beam", home / "whole").sweep, home / "sample")
        yield home


def test_a_sample_is_the_sweep_of_its_plan(made, tmp_path):
    """Fewer crosses and half of the signals, computed by themselves, are the rows of the sample to the last bit."""
    sample = read_sweep(made / "sample")
    assert (sample.plan.size, sample.plan.signals) == (3, 0.5)
    alone = run_sweep(sample.plan, tmp_path / "alone")
    assert sample.table.equals(alone.table)
    assert sample.table.schema.field("clearance").metadata == alone.table.schema.field("clearance").metadata
    assert 0 < sample.table["settled_peak_force"].null_count < 15


def test_a_dataset_made_again_agrees_with_the_sample(made, tmp_path):
    """All rows that both have are identical; a part of the dataset is compared as far as it goes."""
    again = build_dataset("impact-beam", tmp_path / "again", sample=made / "sample", crosses=2)
    assert (again.agreement.rows, again.agreement.identical, again.agreement.sound) == (10, 10, True)
    assert again.drawn == drawn_digest(dataset_plan("impact-beam"))
    assert again.sweep.table.equals(read_sweep(made / "whole").table.slice(0, 10))


def changed(made, folder, column, value):
    """The sample with one value of a column in its place in all rows."""
    sample = read_sweep(made / "sample").table
    place = sample.schema.get_field_index(column)
    values = pa.array([value] * len(sample), sample.schema.field(place).type)
    folder.mkdir()
    pq.write_table(sample.set_column(place, sample.schema.field(place), values), folder / "sweep.parquet")
    return folder


def test_rows_that_differ_end_with_exit_code_1(made, tmp_path):
    """On the same platform one other digit is too many; the numbers are printed."""
    other = changed(made, tmp_path / "other", "peak_force_mean", 1.0)
    command = ("build-dataset", "impact-beam", "--out", str(made / "whole"))
    found = CliRunner().invoke(app, [*command, "--sample", str(other)])
    assert found.exit_code == 1
    assert "0 of 15 rows identical, 15 of the same nature (the same sources" in found.output
    found = CliRunner().invoke(app, [*command, "--sample", str(made / "sample")])
    assert found.exit_code == 0
    assert "15 of 15 rows identical" in found.output
    assert drawn_digest(dataset_plan("impact-beam")) in found.output
    assert "compared with no sample" in CliRunner().invoke(app, [*command, "--no-check"]).output


def test_another_plan_is_refused_before_anything_is_computed(made, tmp_path, monkeypatch):
    """Another axis, other random numbers, or a sweep that is no sample: nothing is written."""
    out = tmp_path / "out"
    with pytest.raises(DatasetError, match="is no sample"):
        build_dataset("impact-beam", out, sample=made / "whole")
    with monkeypatch.context() as patch:
        patch.setitem(RECIPES, "impact-beam", SMALL._replace(axes=(*SMALL.axes, "damping_ratio=0.01:0.02")))
        with pytest.raises(DatasetError, match="it differs in axes; use the release"):
            build_dataset("impact-beam", out, sample=made / "sample")
    with monkeypatch.context() as patch:
        patch.setattr(build, "drawn_digest", lambda plan: "0")
        with pytest.raises(DatasetError, match="it differs in the numbers that numpy draws"):
            build_dataset("impact-beam", out, sample=made / "sample")
    assert not out.exists()


def test_machines_without_a_dataset_are_named(tmp_path):
    """The error lists those that have one."""
    with pytest.raises(DatasetError, match="'pendulum' has no dataset; known: impact-beam, slider-crank"):
        build_dataset("pendulum", tmp_path / "x")


def test_a_sample_is_taken_of_crosses_with_all_signals(made):
    """A sweep that kept fewer would promise signals that it lacks."""
    whole = read_sweep(made / "whole")
    poor = replace(whole, settings={**whole.settings, "signals": 0.5})
    with pytest.raises(DatasetError, match="--sampling crosses:N --label signals=1"):
        sample_of(poor)


@pytest.mark.parametrize("machine", ALL)
def test_shipped_samples_are_of_the_plans_of_this_installation(machine, monkeypatch):
    """A changed base machine, axis or seed makes them stale; so do other numbers of numpy. None exceeds 2 MB."""
    monkeypatch.setitem(RECIPES, machine, ALL[machine])
    plan, sample = dataset_plan(machine), read_sweep(SHIPPED / machine / "sample")
    build._check_plan(plan, sample, "sample")
    kept = json.loads((SHIPPED / machine / "plan.json").read_text())
    assert kept == json.loads(json.dumps({**plan.settings(), "version": kept["version"]}))
    assert (sample.plan.size, len(sample.table)) == (1000, 5000)
    assert (SHIPPED / machine / "sample" / "sweep.parquet").stat().st_size < 2_000_000
    assert drawn_digest(plan) in (SHIPPED / machine / "CARD.md").read_text()
