"""Running sweeps: what a row says, resuming, and never touching what is not ours."""

import errno
import json
import os
import threading
import time
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

import chaosgym.sweeps.label as label_module
import chaosgym.sweeps.plan as plan_module
import chaosgym.sweeps.types_by_default as types_by_default
from chaosgym.diagnosis import diagnose, response_type
from chaosgym.errors import DatasetError, SimulationError, UnfinishedError
from chaosgym.machines import ImpactBeam
from chaosgym.simulation import simulate
from chaosgym.sweeps import Axis, SweepPlan, read_sweep, relabel, run_sweep
from chaosgym.sweeps.folder import SweepFolder
from tests.plain_modes import PLAIN_BEAM

PLAN = SweepPlan(
    PLAIN_BEAM,
    (Axis("excitation_frequency", 18.0, 30.0, 5), Axis("clearance", 0.1e-3, 0.14e-3, 3)),
    budget=100,
)
CROSSES = SweepPlan(
    PLAIN_BEAM,
    (
        Axis("damping_ratio", 0.01, 0.05, scale="log"),
        Axis("excitation_frequency", 18.0, 30.0),
        Axis("clearance", 1e-4, 1.4e-4, scale="log"),
    ),
    "crosses",
    size=10,
    seed=1,
    budget=100,
    signals=0.5,
    full_types=0.3,
)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A small sweep, run once."""
    folder = tmp_path_factory.mktemp("sweep") / "small"
    return folder, run_sweep(PLAN, folder)


@pytest.fixture(scope="module")
def crosses(tmp_path_factory):
    """A few crosses with signals and full types, run once."""
    return run_sweep(CROSSES, tmp_path_factory.mktemp("sweep") / "crosses")


def beam_of(row):
    """The beam of a row."""
    return replace(CROSSES.machine, **{name: row[name] for name in CROSSES.fields})


def test_rows_are_what_simulation_and_diagnosis_say(swept):
    """A row holds the fields in SI, the verdict on that very machine, and figures of the run that was judged."""
    _, sweep = swept
    row = sweep.table.slice(7, 1).to_pylist()[0]
    beam = replace(PLAN.machine, excitation_frequency=row["excitation_frequency"], clearance=row["clearance"])
    verdict = diagnose(beam, budget=100)
    judged = simulate(beam, 100).after(50)
    assert (row["nature"], row["period"], row["status"]) == (verdict.nature, verdict.period, verdict.status)
    assert row["peak_force_max"] == np.float32(judged.peak_force[:, 0].max())
    assert row["horizon"] == 100
    exponent = verdict.evidence["largest_lyapunov_exponent_per_cycle"]
    assert row["exponent"] == np.float32(exponent["value"])


@pytest.mark.parametrize("definition", ["settled", "thesis"])
def test_rows_say_whose_nature_they_have(tmp_path, definition):
    """A beam whose chaos dies out is periodic, and chaotic by the thesis' definition (5.2.3); the file states which."""
    beam = replace(PLAIN_BEAM, clearance=0.158e-3, damping_ratio=0.028)
    axes = (Axis("excitation_frequency", 12.0, 27.2, 2),)
    sweep = run_sweep(SweepPlan(beam, axes, full_types=1.0, initial_states=1, definition=definition), tmp_path / "s")
    verdict = diagnose(replace(beam, excitation_frequency=27.2), budget=400).labelled(definition)
    assert sweep.column("nature").tolist() == ["periodic", verdict.nature]
    assert sweep.column("status").tolist() == ["certified", verdict.status]
    assert sweep.column("transient_chaos").tolist() == [0, verdict.transient_chaos]
    assert verdict.transient_chaos > 50
    assert sweep.column("headline")[1] == verdict.statement.headline
    assert (verdict.nature == "chaotic") == (definition == "thesis")
    beside = response_type(
        replace(beam, excitation_frequency=27.2), budget=400, initial_states=1, definition=definition, workers=1
    )
    assert beside.reason.startswith("the nominal response is chaotic") == (definition == "thesis")
    assert sweep.column("response_type")[1] == beside.type
    assert sweep.definition == definition
    assert SweepPlan.from_settings(sweep.settings).definition == definition
    meaning = sweep.table.schema.field("nature").metadata[b"meaning"].decode()
    assert ("thesis 5.2.3" in meaning) == (definition == "thesis")


def test_signals_are_the_cycles_of_the_run_from_rest(crosses):
    """Cycles 0 to 63 and 200 to 263 in float32, for about half of the rows."""
    rows = [row for row in crosses.table.to_pylist() if row["settled_peak_force"] is not None]
    assert 0.4 < len(rows) / len(CROSSES) < 0.6
    record = simulate(beam_of(rows[3]), 264)
    np.testing.assert_array_equal(rows[3]["start_velocity"], record.velocity[:64].astype(np.float32))
    np.testing.assert_array_equal(rows[3]["start_displacement"], record.displacement[:64].astype(np.float32))
    for window, cycles in (("start", slice(0, 64)), ("settled", slice(200, 264))):
        np.testing.assert_array_equal(rows[3][f"{window}_peak_force"], record.peak_force[cycles, 0].astype(np.float32))


def test_the_type_of_a_centre_is_that_of_its_cross(crosses):
    """The rule of 5.5 on the five points; the other four have no type of their own."""
    natures, peaks, types = (crosses.column(name) for name in ("nature", "largest_peak", "response_type"))
    assert {*types} >= {"I", None, "III"}
    for centre in range(0, len(CROSSES), 5):
        arms = slice(centre + 1, centre + 5)
        assert types[arms].tolist() == [None] * 4
        assert len({*crosses.column("machine")[centre : centre + 5]}) == 1
        restless = natures[arms] != "periodic"
        if natures[centre] != "periodic" or restless[:2].all() or restless[2:].all():
            assert types[centre] == "III"
        else:
            assert types[centre] == ("II" if restless.any() or (peaks[arms] > 1.1 * peaks[centre]).any() else "I")


def test_irregularity_is_what_a_sensor_must_resolve(crosses):
    """Of the settled signal where it is kept: nearly none where certified; what is resolvable exceeds 3 N."""
    scatter, calm = crosses.column("irregularity"), crosses.column("status") == "certified"
    assert np.median(scatter[calm]) < 0.01
    np.testing.assert_array_equal(crosses.column("resolvable"), scatter > 3.0)
    rows = [row for row in crosses.table.to_pylist() if row["settled_peak_force"] is not None]
    widest = max(rows, key=lambda row: row["irregularity"])
    peaks = np.array(widest["settled_peak_force"], dtype=np.float32).astype(float)
    classes = [[peaks[64 % k :][first::k] for first in range(k)] for k in range(1, 17)]
    least = min(max(0.5 * np.ptp(part) for part in parts) for parts in classes)
    assert widest["irregularity"] == np.float32(least)


def test_full_types_are_judged_over_all_tolerances(crosses):
    """They equal ``response_type`` and stand only where all neighbours are in the sweep."""
    rows = [row for row in crosses.table.to_pylist() if row["full_response_type"] is not None]
    assert rows
    assert {row["type_neighbours"] for row in rows} == {4}
    assert rows[0]["full_response_type"] == response_type(beam_of(rows[0]), budget=100).type


def test_a_split_never_cuts_a_machine(crosses):
    """All rows of a machine lie in one part, and most machines are for training."""
    parts = {}
    for number, part in zip(crosses.column("machine"), crosses.column("split"), strict=True):
        parts.setdefault(int(number), set()).add(part)
    assert [len(part) for part in parts.values()] == [1] * 10
    assert 4 <= [part for part in parts.values()].count({"train"}) <= 10


def test_random_points_are_typed_over_the_full_window(tmp_path):
    """Points without neighbours get their response type from runs of their own, where that is asked for."""
    axes = tuple(Axis(axis.field, axis.low, axis.high) for axis in PLAN.axes)
    plan = SweepPlan(PLAIN_BEAM, axes, "random", size=4, budget=100, full_types=1.0)
    sweep = run_sweep(plan, tmp_path / "s")
    beam = ImpactBeam(**{name: float(sweep.column(name)[2]) for name in plan.fields})
    assert sweep.column("response_type")[2] == response_type(beam, budget=100).type
    bare = run_sweep(replace(plan, full_types=0.0), tmp_path / "t")
    assert set(bare.column("response_type")) == {None}


def test_rows_can_be_computed_again_bit_for_bit(crosses):
    """What stands in a row follows from the settings in the file and the row's number."""
    again = relabel(crosses, (3, 41))
    names = [name for name in again.schema.names if name not in ("response_type", "type_neighbours")]
    assert again.select(names).equals(crosses.table.take([3, 41]).select(names))


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
    assert schema.field("response_type").metadata[b"meaning"].startswith(b"as full_response_type"), "as of no cross"
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


def test_stopped_sweep_goes_on_and_ends_with_the_same_rows(swept, tmp_path, monkeypatch):
    """After an interruption only the missing chunks are computed, and the rows equal those of an undisturbed run."""
    whole, _ = swept
    monkeypatch.setattr(plan_module, "CHUNK_SIZE", 4)
    computed = []
    honest = label_module.label_point

    def interrupted(machine, budget, **how):
        if len(computed) == 9:
            raise KeyboardInterrupt
        computed.append(machine)
        return honest(machine, budget, **how)

    monkeypatch.setattr(label_module, "label_point", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_sweep(PLAN, tmp_path / "s", workers=1)
    kept = sorted((tmp_path / "s" / "chunks").glob("*.parquet"))
    assert len(kept) == 2
    with pytest.raises(DatasetError, match="no finished sweep"):
        read_sweep(tmp_path / "s")
    computed.clear()
    monkeypatch.setattr(label_module, "label_point", lambda *a, **k: computed.append(a) or honest(*a, **k))
    run_sweep(PLAN, tmp_path / "s", workers=2)
    assert len(computed) == 15 - 8
    monkeypatch.undo()
    assert pq.read_table(tmp_path / "s" / "sweep.parquet").equals(pq.read_table(whole / "sweep.parquet"))
    assert pq.ParquetFile(tmp_path / "s" / "sweep.parquet").num_row_groups == 4
    assert not (tmp_path / "s" / "chunks").exists()


def test_ctrl_c_ends_the_other_threads_at_their_row(tmp_path, monkeypatch):
    """One thread is interrupted; the other, at the first of its many rows, ends with it rather than with its chunk."""
    rows, interrupted = [], threading.Event()

    def slow(machine, budget, **_):
        rows.append(machine)
        if len(rows) == 1:
            interrupted.wait(30.0)
            raise KeyboardInterrupt
        interrupted.set()
        time.sleep(0.3)
        return {"status": "failed", "reason": "nothing was run"}

    monkeypatch.setattr(label_module, "label_point", slow)
    monkeypatch.setattr(plan_module, "CHUNK_SIZE", 200)
    axes = (Axis("excitation_frequency", 18.0, 30.0), Axis("clearance", 1e-4, 1.4e-4))
    with pytest.raises(KeyboardInterrupt):
        run_sweep(SweepPlan(PLAIN_BEAM, axes, "sobol", size=400), tmp_path / "s", workers=2)
    assert len(rows) < 10


def test_a_full_disk_loses_nothing(swept, tmp_path, monkeypatch):
    """The third chunk finds no space: what was kept stays, no half file is left, and the same call ends the sweep."""
    whole, _ = swept
    monkeypatch.setattr(plan_module, "CHUNK_SIZE", 4)
    honest, tables = pq.ParquetWriter.write_table, []

    def full(writer, table, *arguments, **options):
        tables.append(table)
        if len(tables) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        honest(writer, table, *arguments, **options)

    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)
    with pytest.raises(UnfinishedError, match="no space left"):
        run_sweep(PLAN, tmp_path / "s", workers=1)
    assert len(list((tmp_path / "s" / "chunks").iterdir())) == 2
    monkeypatch.setattr(pq.ParquetWriter, "write_table", honest)
    run_sweep(PLAN, tmp_path / "s")
    assert pq.read_table(tmp_path / "s" / "sweep.parquet").equals(pq.read_table(whole / "sweep.parquet"))


def test_damage_is_named_and_repaired(tmp_path, monkeypatch):
    """A flipped bit in a chunk, kept or joined, is found by its checksum; with repair that chunk is computed again."""
    monkeypatch.setattr(plan_module, "CHUNK_SIZE", 4)
    whole = run_sweep(PLAN, tmp_path / "s").table
    file = tmp_path / "s" / "sweep.parquet"
    column = pq.ParquetFile(file).metadata.row_group(2).column(0)
    place = column.data_page_offset + column.total_compressed_size - 3
    sound = file.read_bytes()
    file.write_bytes(sound[:place] + bytes([sound[place] ^ 1]) + sound[place + 1 :])
    with pytest.raises(DatasetError, match=r"row group 2 of sweep.parquet damaged.*--repair"):
        run_sweep(PLAN, tmp_path / "s")
    computed = []
    honest = label_module.label_point
    monkeypatch.setattr(label_module, "label_point", lambda *a, **k: computed.append(a) or honest(*a, **k))
    assert run_sweep(PLAN, tmp_path / "s", repair=True).table.equals(whole)
    assert len(computed) == 4
    file.write_bytes(b"PAR1 no")
    with pytest.raises(DatasetError, match=r"sweep.parquet damaged"):
        run_sweep(PLAN, tmp_path / "s")
    assert run_sweep(PLAN, tmp_path / "s", repair=True).table.equals(whole)

    store = tmp_path / "t"
    with monkeypatch.context() as context:
        context.setattr("chaosgym.sweeps.folder.SweepFolder.finish", lambda self: None)
        with pytest.raises(DatasetError, match="no finished sweep"):
            run_sweep(PLAN, store)
    (store / "chunks" / "000000000004.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(DatasetError, match=r"000000000004.parquet damaged.*--repair"):
        run_sweep(PLAN, store)
    assert run_sweep(PLAN, store, repair=True).table.equals(whole)


def test_failed_runs_are_rows(tmp_path, monkeypatch):
    """A machine that can't be simulated is a row with status failed and the reason, not a missing one."""
    monkeypatch.setattr(label_module, "diagnose_alone", _fail)
    sweep = run_sweep(PLAN, tmp_path / "s")
    assert set(sweep.column("status")) == {"failed"}
    assert np.all([reason.startswith("no luck") for reason in sweep.column("reason")])
    assert set(sweep.column("response_type")) == {"undetermined"}


def _fail(machine, *, budget):
    raise SimulationError("no luck")


def test_impossible_machines_are_rows(tmp_path):
    """A point that is no machine, here one whose shaker pushes beyond the tip, fails by itself."""
    plan = SweepPlan(PLAIN_BEAM, (Axis("length", 0.17, 0.28, 2),), budget=100)
    sweep = run_sweep(plan, tmp_path / "s")
    assert list(sweep.column("status")) == ["failed", "agreed"]
    assert "force_position" in sweep.column("reason")[0]


def test_other_settings_and_foreign_folders_are_refused(swept, tmp_path):
    """Another plan, or a folder with anything else in it, is left alone."""
    folder, _ = swept
    other = replace(PLAN, budget=101)
    with pytest.raises(DatasetError, match=r"another sweep.*budget"):
        run_sweep(other, folder)
    (tmp_path / "note.txt").write_text("mine")
    with pytest.raises(DatasetError, match="is no run of this sweep"):
        run_sweep(PLAN, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]
    (folder.parent / "damaged").mkdir(exist_ok=True)
    (folder.parent / "damaged" / "sweep.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(DatasetError, match="can't be read"):
        read_sweep(folder.parent / "damaged")


def test_types_that_take_long_are_left_to_the_user(tmp_path, monkeypatch):
    """The choice is made by the expected time, and a folder keeps the choice that it was begun with."""
    plan = SweepPlan(PLAIN_BEAM, (Axis("excitation_frequency", 10.0, 20.0, 30),))
    monkeypatch.setattr(types_by_default, "full_type", lambda machine, plan: {"full_response_type": "I"})
    quick = types_by_default.with_affordable_types(plan, tmp_path)
    assert quick.plan.full_types == 1.0
    assert quick.timed.seconds < 1.0
    assert len(quick.timed.known) == types_by_default.TIMED + 1
    monkeypatch.setattr(types_by_default, "AFFORDABLE", 0.0)
    slow = types_by_default.with_affordable_types(plan, tmp_path, workers=2)
    assert slow.plan == plan
    assert len(slow.timed.known) == types_by_default.ENOUGH + 1
    SweepFolder(tmp_path, quick.plan, "1")
    assert types_by_default.with_affordable_types(plan, tmp_path) == (quick.plan, None)


def test_no_type_is_timed_for_a_folder_that_is_refused(tmp_path, monkeypatch):
    """Whoever names a folder with other things in it is told so at once."""
    (tmp_path / "note.txt").write_text("mine")
    monkeypatch.setattr(types_by_default, "full_type", lambda machine, plan: pytest.fail("a type was timed"))
    plan = SweepPlan(PLAIN_BEAM, (Axis("excitation_frequency", 10.0, 20.0, 30),))
    with pytest.raises(DatasetError, match="is no run of this sweep"):
        types_by_default.with_affordable_types(plan, tmp_path)


def test_the_told_time_of_types_is_that_of_points_all_over_the_plan(monkeypatch):
    """Points that differ in cost a hundredfold along either axis are met in about their shares."""
    axes = (Axis("excitation_frequency", 18.0, 30.0, 25), Axis("clearance", 0.1e-3, 0.14e-3, 3))
    plan, clock = replace(PLAN, axes=axes, full_types=1.0), [0.0]

    def timed(machine, plan):
        clock[0] += 1.0 if machine.excitation_frequency > 24.0 and machine.clearance > 0.11e-3 else 0.01
        return {"full_response_type": "I"}

    monkeypatch.setattr(types_by_default, "full_type", timed)
    monkeypatch.setattr(types_by_default, "process_time", lambda: clock[0])
    told = types_by_default.timed_types(plan).seconds * len(plan)
    clock[0] = 0.0
    for row in range(len(plan)):
        timed(plan.machine_at({name: column[0] for name, column in plan.points(range(row, row + 1)).items()}), plan)
    assert clock[0] / 1.5 < told < clock[0] * 1.5


def test_types_of_minutes_are_timed_once(monkeypatch):
    """The first point, which else warms up, tells the time where it takes long; no further one is waited for."""
    clock = [0.0]

    def slow(machine, plan):
        clock[0] += 100.0
        return {"full_response_type": "I"}

    monkeypatch.setattr(types_by_default, "full_type", slow)
    monkeypatch.setattr(types_by_default, "process_time", lambda: clock[0])
    timed = types_by_default.timed_types(replace(PLAN, full_types=1.0))
    assert (len(timed.known), timed.seconds) == (1, 100.0)


def test_types_that_were_timed_are_kept(tmp_path, monkeypatch):
    """The sweep takes them as they are, and computes the others."""
    plan = SweepPlan(PLAIN_BEAM, (Axis("excitation_frequency", 10.0, 12.0, 5),), full_types=1.0)
    asked = []
    monkeypatch.setattr(
        label_module, "full_type", lambda machine, plan: asked.append(machine) or {"full_response_type": "II"}
    )
    sweep = run_sweep(plan, tmp_path / "s", workers=1, known={2: {"full_response_type": "I"}})
    assert sweep.column("full_response_type").tolist() == ["II", "II", "I", "II", "II"]
    assert len(asked) == 4
