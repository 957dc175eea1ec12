"""Damaged and hostile files: every command says in one line what is wrong, and takes no more memory than is sound."""

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from chaosgym.classifier.storage import LARGEST, read_model
from chaosgym.control.policies import load_policy
from chaosgym.errors import DatasetError, ModelFileError
from chaosgym.files import unpacked
from chaosgym.sweeps import read_sweep
from chaosgym.sweeps.info import dataset_info
from tests.cli.run import run

DATASET = Path(__file__).parents[2] / "datasets" / "impact-beam" / "sample"


def _bomb(members: int = 1, bytes_each: int = LARGEST + 1) -> bytes:
    """An archive of zeros: a thousandth of the size that it unpacks to."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(members):
            archive.writestr(f"{number}.npy", bytes(bytes_each))
    return buffer.getvalue()


def _liar(shape: tuple[int, ...]) -> bytes:
    """An archive of one array of eight bytes whose head claims a shape."""
    array, buffer = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(array, {"descr": "<f8", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("head.npy", array.getvalue() + bytes(8))
    return buffer.getvalue()


def test_a_bomb_is_not_unpacked(tmp_path):
    """The bound holds for all members together, for classifiers and policies alike; the file itself is small."""
    content = _bomb(members=3, bytes_each=LARGEST // 2)
    assert len(content) < LARGEST // 100
    with pytest.raises(ValueError, match="unpacked it has"):
        unpacked(content, LARGEST)
    (tmp_path / "bomb.npz").write_bytes(content)
    with pytest.raises(ModelFileError, match="unpacked it has"):
        read_model(tmp_path / "bomb.npz")
    code, out, err = run("classify", "impact-beam", "--model", str(tmp_path / "bomb.npz"))
    assert (code, out, err.count("\n")) == (2, "", 1)


@pytest.mark.parametrize("shape", [(2,), (2**40,), (2**60,)])
def test_an_array_that_claims_more_than_there_is_is_refused(shape, tmp_path):
    """Whether the computer has that much memory or not."""
    with pytest.raises(ValueError, match=r"claims [0-9]+ bytes and has 8"):
        unpacked(_liar(shape), LARGEST)
    (tmp_path / "liar.npz").write_bytes(_liar(shape))
    with pytest.raises(ModelFileError):
        read_model(tmp_path / "liar.npz")


def test_nesting_without_end_is_damage(tmp_path):
    """A description or a plan of 100,000 brackets is named, not a crash of the parser."""
    (tmp_path / "policy.json").write_text("[" * 100_000)
    (tmp_path / "weights.npz").write_bytes(b"")
    with pytest.raises(ModelFileError):
        load_policy(tmp_path)
    (tmp_path / "plan.json").write_text("[" * 100_000)
    with pytest.raises(DatasetError, match="is damaged"):
        dataset_info(tmp_path)
    (tmp_path / "plan.json").write_text('{"machine": "impact-beam"}')
    with pytest.raises(DatasetError, match="is damaged: KeyError"):
        dataset_info(tmp_path)


FOOTERS = {
    "definitions": b"{",
    "provenance": b"7",
    "chaosgym": json.dumps({"machine": "impact-beam", "axes": 3}).encode(),
}


@pytest.mark.parametrize("key", FOOTERS)
def test_damage_in_the_metadata_of_a_dataset_is_named(key, tmp_path):
    """Whatever the footer says instead: one error for info, card and whoever reads."""
    table = pq.read_table(DATASET / "sweep.parquet").slice(0, 5)
    assert read_sweep(DATASET).plan.machine.name == "impact-beam"
    changed = table.replace_schema_metadata({**table.schema.metadata, key.encode(): FOOTERS[key]})
    pq.write_table(changed, tmp_path / "sweep.parquet")
    with pytest.raises(DatasetError, match="can't be read as a chaosgym sweep"):
        dataset_info(tmp_path)


@pytest.mark.parametrize(
    "arguments",
    [
        ("diagnose", "impact-beam", "--sensor-error", "inf"),
        ("judge", "-", "--sensor-error", "nan"),
        ("classify", "impact-beam", "-", "--sensor-error", "inf"),
        ("judge", "-", "--load-rating", "1000"),
    ],
)
def test_numbers_that_are_none_end_in_one_line(arguments, tmp_path):
    """Errors without bound and forces of 1e308 N: exit 2 and one line, with --json too."""
    file = tmp_path / "peaks.csv"
    file.write_text("\n".join(["1e308", "9e307"] * 60))
    code, out, err = run(*[str(file) if word == "-" else word for word in arguments], "--json")
    assert (code, out) == (2, "")
    *progress, error = err.splitlines()
    assert error.startswith("Error: ")
    assert all(line.endswith(" s") for line in progress)


TITLES = {
    "a newline": "a\nb [N]",
    "500,000 letters": "a" * 500_000 + " [N]",
    "250,000 words": "b " * 250_000,
    "a unit of 500,000 letters": f"a [{'N' * 500_000}]",
    "500,000 newlines": "\n" * 500_000 + "f [N]",
}


@pytest.mark.parametrize("kind", ["csv", "parquet", "h5"])
@pytest.mark.parametrize("title", TITLES.values(), ids=TITLES)
def test_a_title_of_many_lines_or_letters_spoils_no_answer(kind, title, tmp_path):
    """As many lines as with a plain title, none of them long, whatever writes the file; JSON as published."""

    def told(name, file):
        path = tmp_path / f"{file}.{kind}"
        peaks = [30.0 + number % 2 for number in range(60)]
        if kind == "csv":
            path.write_text(f'cycle;"{name}"\n' + "".join(f"{k};{peak}\n" for k, peak in enumerate(peaks)))
        elif kind == "parquet":
            pq.write_table(pa.table({"cycle": range(60), name: peaks}), path)
        else:
            h5py = pytest.importorskip("h5py")
            with h5py.File(path, "w") as data:
                data[name[:60_000]] = peaks  # HDF5 holds no longer name
        code, out, err = run("judge", path)
        assert code == 0, err[:1000]
        return out.splitlines()

    plain, lines = told("force [N]", "plain"), told(title, "odd")
    assert len(lines) == len(plain)
    assert max(map(len, lines)) < max(map(len, plain)) + 500
    assert lines[0].split(": ", 1)[1:] == plain[0].split(": ", 1)[1:]
