"""The benchmark of models within a tolerance: it goes on where it stopped, and its shipped rows keep the promise."""

from pathlib import Path

from benchmarks.fidelity import accuracy
from benchmarks.fidelity.accuracy import KINDS, machine_of, measure, reference_of, rows_of, summary_of
from chaosgym.machines.accuracy import model_within

SHIPPED = Path(__file__).parents[2] / "docs" / "data" / "accuracy.csv"


def test_it_goes_on_where_it_stopped(tmp_path, monkeypatch):
    """A second call computes the rows that are missing alone, and finds the same machines."""
    monkeypatch.setattr(accuracy, "TRANSIENT", 20)
    monkeypatch.setattr(accuracy, "KINDS", {"modes": KINDS["modes"], "matrices": KINDS["matrices"]})
    path = tmp_path / "rows.csv"
    first = [row["index"] for row in measure(path, 1, 0, "5 %")]
    more = [row["index"] for row in measure(path, 2, 0, "5 %")]
    assert (first, more) == ([0], [1])
    assert [row["kind"] for row in rows_of(path)] == ["modes", "matrices"]
    assert list(measure(path, 2, 0, "5 %")) == []
    assert summary_of(rows_of(path), "5 %")["all"]["machines"] == 2


def test_the_reference_is_finer_than_what_the_estimate_has_seen():
    """Two steps finer than the chosen model; of a file's modes all of them."""
    for index, kind in enumerate(KINDS):
        chosen = model_within(machine_of(index, kind, 0), "1 %").machine
        reference = reference_of(chosen)
        if reference is not None:
            seen, numbers = chosen.finer.model_numbers, reference.model_numbers
            assert kind == "modes" or numbers != seen
            assert all(numbers[name] >= seen[name] or "interval" in name for name in seen)


def test_the_shipped_rows_keep_what_is_promised():
    """Of machines that an estimate calls within 1 %, 95 % are, and 99 % within 2 %, at points that repeat."""
    found = summary_of(rows_of(SHIPPED), "1 %")
    assert set(found) == {*KINDS, "all"}
    assert found["all"]["machines"] == 500
    assert found["all"]["periodic"] > 200
    assert found["all"]["within"] >= 0.95
    assert found["all"]["within_twice"] >= 0.99
    assert found["all"]["bounded"] >= 0.95
