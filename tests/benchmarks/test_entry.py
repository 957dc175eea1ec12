"""An entry of the table of results is played again before it is believed."""

import pyarrow as pa
import pytest

from benchmarks.envs.entry import entry, lines, task_of
from chaosgym.control.comparison import compare, subject_of, write_comparison
from chaosgym.control.policies.shipped import shipped_folder, shipped_policy
from chaosgym.control.scores import ONE, ZERO
from chaosgym.errors import DatasetError

BEAM = "chaosgym/ImpactBeamTolerance-v1"
FLEET = {"level": "fleet", "split": "test"}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Four machines, the shipped map of the fleet."""
    path = tmp_path_factory.mktemp("entry") / "entry.parquet"
    policies = {"map": [shipped_policy(BEAM, "fleet")]}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("chaosgym.control.comparison.WORN_LEVELS", 1)  # the own map sets the scale, however good it is
        return path, compare(BEAM, path, machines=4, only=[ZERO, ONE], policies=policies, **FLEET)


def checked(path, **options):
    """The entry, which may be of few machines."""
    return entry(path, "map", [shipped_folder(BEAM, "fleet")], again=4, **{"fewest": 4} | options)


def test_what_was_played_comes_out_again(written):
    """With the row that the table shows."""
    found = checked(written[0])
    assert found["of"] == subject_of(BEAM, **FLEET)
    assert found["row"]["machines"] == found["again"] == 4
    assert lines(found)[-1].startswith("| map | measurements | 1 | 4 | ")


def changed(table, name, by):
    """The table with the returns of a contender moved."""
    mine = pa.compute.equal(table["contender"], name)
    returns = pa.compute.if_else(mine, pa.compute.add(table["job_return"], by), table["job_return"])
    return table.set_column(table.column_names.index("job_return"), "job_return", returns)


@pytest.mark.parametrize(("name", "who"), [("map", "'map', seed 0"), (ZERO, ZERO)])
def test_better_returns_than_were_played_are_refused(written, tmp_path, name, who):
    """Of the policy, and of following, which sets the scale."""
    write_comparison(changed(written[1], name, 0.5), tmp_path / "entry.parquet")
    with pytest.raises(DatasetError, match=f"^{who} has .* on machine 0"):
        checked(tmp_path / "entry.parquet")


def test_chosen_machines_and_another_policy_are_refused(written, tmp_path):
    """All from number 0 on, enough of them, and by the policy whose folder is given."""
    with pytest.raises(DatasetError, match=r"played 4 machines .* 32 or more"):
        checked(written[0], fewest=32)
    write_comparison(written[1].filter(pa.compute.greater(written[1]["machine"], 0)), tmp_path / "chosen.parquet")
    with pytest.raises(DatasetError, match="played 3 machines from number 1 on"):
        checked(tmp_path / "chosen.parquet", fewest=3)
    with pytest.raises(DatasetError, match="'map', seed 0 has"):
        entry(written[0], "map", [shipped_folder(BEAM)], again=4, fewest=4)
    with pytest.raises(DatasetError, match=r"has \[1\] seeds"):
        entry(written[0], "map", [shipped_folder(BEAM)] * 2, again=4, fewest=4)


def test_a_subject_tells_its_task():
    """There and back; a machine's file is no task of the table."""
    for keywords in ({}, FLEET, {"objective": "life", "sealed": True}):
        assert task_of(subject_of(BEAM, **keywords)) == (BEAM, keywords)
    with pytest.raises(DatasetError, match="no task of the table"):
        task_of("mine.toml (0123abcd)")
