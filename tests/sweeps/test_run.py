"""Running sweeps: what a row says, resuming, and never touching what is not ours."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import chaosgym.sweeps.run as run_module
from chaosgym.diagnosis import two_step_test
from chaosgym.errors import DatasetError
from chaosgym.machines import THESIS_IMPACT_BEAM, ImpactBeam
from chaosgym.simulation import simulate
from chaosgym.sweeps import Axis, SweepPlan, read_sweep, run_sweep

PLAN = SweepPlan(
    THESIS_IMPACT_BEAM,
    (Axis("excitation_frequency", 18.0, 30.0, 5), Axis("clearance", 0.1e-3, 0.14e-3, 3)),
    transient=50,
    cycles=60,
)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A small sweep, run once."""
    folder = tmp_path_factory.mktemp("sweep") / "small"
    return folder, run_sweep(PLAN, folder)


def test_rows_are_what_simulation_and_diagnosis_say(swept):
    """A row holds the fields in SI and the verdict on that very machine."""
    _, sweep = swept
    row = sweep.table.slice(7, 1).to_pylist()[0]
    beam = ImpactBeam(excitation_frequency=row["excitation_frequency"], clearance=row["clearance"])
    record = simulate(beam, 60, transient=50)
    verdict = two_step_test(record)
    assert (row["nature"], row["period"]) == (verdict.nature, verdict.period)
    assert row["peak_force_max"] == record.peak_force[:, 0].max()
    assert row["status"] in ("labelled", "undetermined")


def test_every_point_has_a_type_and_chaos_is_type_iii(swept):
    """On a grid over speed and clearance each point is typed by its neighbours."""
    _, sweep = swept
    types, natures = sweep.column("response_type"), sweep.column("nature")
    assert len(types) == 15
    assert set(types) <= {"I", "II", "III", "undetermined"}
    assert set(types[natures == "chaotic"]) == {"III"}


def test_file_explains_itself(swept):
    """Units, meanings and provenance stand in the Parquet schema."""
    folder, _ = swept
    schema = pq.read_schema(folder / "sweep.parquet")
    assert schema.field("clearance").metadata[b"unit"] == b"m"
    assert schema.field("response_type").metadata[b"meaning"]
    provenance = json.loads(schema.metadata[b"chaosgym"])
    assert provenance["machine"] == "impact-beam"
    assert provenance["seed"] == 0
    assert provenance["version"]


def test_same_command_again_reads_the_finished_sweep(swept):
    """Nothing is computed twice or written again."""
    folder, sweep = swept
    before = (folder / "sweep.parquet").stat().st_mtime_ns
    assert run_sweep(PLAN, folder).table.equals(sweep.table)
    assert (folder / "sweep.parquet").stat().st_mtime_ns == before
    assert read_sweep(folder).shape == (5, 3)


def test_stopped_sweep_goes_on_and_ends_with_the_same_bytes(swept, tmp_path, monkeypatch):
    """After an interruption only the missing chunks are computed, and the file equals that of an undisturbed run."""
    whole, _ = swept
    monkeypatch.setattr(run_module, "CHUNK_SIZE", 4)
    computed = []
    honest = run_module.label_point

    def interrupted(machine, transient, cycles):
        if len(computed) == 9:
            raise KeyboardInterrupt
        computed.append(machine)
        return honest(machine, transient, cycles)

    monkeypatch.setattr(run_module, "label_point", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_sweep(PLAN, tmp_path / "s", workers=1)
    kept = sorted((tmp_path / "s" / "chunks").glob("*.parquet"))
    assert len(kept) == 2
    with pytest.raises(DatasetError, match="no finished sweep"):
        read_sweep(tmp_path / "s")
    computed.clear()
    monkeypatch.setattr(run_module, "label_point", lambda *a: computed.append(a) or honest(*a))
    run_sweep(PLAN, tmp_path / "s", workers=2)
    assert len(computed) == 15 - 8
    monkeypatch.undo()
    assert pq.read_table(tmp_path / "s" / "sweep.parquet").equals(pq.read_table(whole / "sweep.parquet"))


def test_failed_runs_are_rows(tmp_path, monkeypatch):
    """A machine that can't be simulated is a row with status failed and the reason, not a missing one."""
    monkeypatch.setattr(run_module, "simulate", _fail)
    sweep = run_sweep(PLAN, tmp_path / "s")
    assert set(sweep.column("status")) == {"failed"}
    assert np.all([reason.startswith("no luck") for reason in sweep.column("reason")])
    assert set(sweep.column("response_type")) == {"undetermined"}


def _fail(machine, cycles, transient):
    from chaosgym.errors import SimulationError

    raise SimulationError("no luck")


def test_other_settings_and_foreign_folders_are_refused(swept, tmp_path):
    """Another plan, or a folder with anything else in it, is left alone."""
    folder, _ = swept
    other = SweepPlan(PLAN.machine, PLAN.axes, transient=51, cycles=60)
    with pytest.raises(DatasetError, match=r"another sweep.*transient"):
        run_sweep(other, folder)
    (tmp_path / "note.txt").write_text("mine")
    with pytest.raises(DatasetError, match="is no run of this sweep"):
        run_sweep(PLAN, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]
    (folder.parent / "damaged").mkdir(exist_ok=True)
    (folder.parent / "damaged" / "sweep.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(DatasetError, match="can't be read"):
        read_sweep(folder.parent / "damaged")
