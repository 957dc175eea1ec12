"""Files of matrices: what is read is what scipy and numpy wrote, and what is damaged is refused by name."""

import io

import numpy as np
import pytest
from scipy.io import mmwrite
from scipy.sparse import coo_array, random_array

from chaosgym import read_machine
from chaosgym.errors import ParameterError
from chaosgym.machines.machine_file import template
from chaosgym.machines.modal_machine import archives
from chaosgym.machines.modal_machine.archives import read_archive, read_matrix

M, K = np.diag([1.0, 2.0]), np.array([[3.0, -1.0], [-1.0, 4.0]])


def refused(call, path):
    """The line with which a file is refused, after its name."""
    with pytest.raises(ParameterError) as told:
        call(path)
    line = str(told.value)
    assert line.startswith(f"{path} ") or line.startswith(f"{path}:")
    assert "\n" not in line
    return line.removeprefix(str(path)).strip()


def market(tmp_path, text):
    """A Matrix Market file of this text below its first words."""
    path = tmp_path / "K.mtx"
    path.write_text("%%MatrixMarket matrix " + text)
    return path


def test_an_archive_gives_its_arrays_and_no_others(tmp_path):
    """M and K always; C, base and names where they are; what else is in it is left."""
    path = tmp_path / "m.npz"
    np.savez(path, M=M, K=K, other=np.ones(2))
    assert {name: value.tolist() for name, value in read_archive(path).items()} == {"M": M.tolist(), "K": K.tolist()}
    np.savez(path, M=M, K=K, C=K, base=[1.0, 1.0], names=["a", "b"])
    assert list(read_archive(path)) == ["M", "K", "C", "base", "names"]


def test_an_archive_without_its_arrays_is_refused(tmp_path):
    """The line names what is missing and what there is."""
    path = tmp_path / "m.npz"
    for held, line in (
        ({"K": K, "C": K}, "holds no array M; it has K, C"),
        ({"M": M}, "holds no array K; it has M"),
        ({}, "holds no array M; it has none"),
    ):
        np.savez(path, **held)
        assert refused(read_archive, path) == line
    for names in ([1, 2], [["a", "b"]], "a"):
        np.savez(path, M=M, K=K, names=names)
        assert refused(read_archive, path) == ": names is no list of texts, one for each row of M"


def test_what_is_no_archive_is_refused(tmp_path):
    """A missing file, one that is none, and one that is larger than the bound: each line says so once."""
    path = tmp_path / "m.npz"
    assert refused(read_archive, path) == "can't be read: No such file or directory"
    path.write_bytes(b"PK")
    assert refused(read_archive, path).startswith("can't be read as .npz: the archive is damaged: ")
    assert refused(read_matrix, path).startswith("can't be read as a matrix: ")


def test_the_bound_holds_for_the_file_and_for_what_it_unpacks_to(tmp_path, monkeypatch):
    """An archive of zeros is small; unpacked it is not."""
    path = tmp_path / "m.npz"
    np.savez_compressed(path, M=np.zeros((100, 100)), K=np.zeros((100, 100)))
    size = path.stat().st_size
    monkeypatch.setattr(archives, "LARGEST", 160_000)
    assert refused(read_archive, path).startswith("can't be read as .npz: unpacked it has 160")
    monkeypatch.setattr(archives, "LARGEST", size - 1)
    assert refused(read_archive, path) == f"can't be read: it has {size} bytes; allowed: up to {size - 1}"
    np.save(tmp_path / "m.npy", M)
    size = (tmp_path / "m.npy").stat().st_size
    monkeypatch.setattr(archives, "LARGEST", size - 1)
    assert "allowed: up to" in refused(read_matrix, tmp_path / "m.npy")
    monkeypatch.setattr(archives, "LARGEST", size)
    assert read_matrix(tmp_path / "m.npy").tolist() == M.tolist()


def symmetric(rows):
    """A sparse symmetric matrix with a full diagonal, no two entries of which are equal."""
    half = random_array((rows, rows), density=0.3, rng=np.random.default_rng(rows))
    return coo_array(half + half.T + np.diag(np.arange(1.0, rows + 1)))


@pytest.mark.parametrize("shape", ["general", "symmetric"])
@pytest.mark.parametrize("dense", [False, True])
def test_matrix_market_as_scipy_writes_it(shape, dense, tmp_path):
    """Full and sparse, whole and by its lower half, with comments."""
    wanted = symmetric(7).toarray()
    if shape == "general":
        wanted[0, 3] += 1.0
    path = tmp_path / "K.mtx"
    mmwrite(path, wanted if dense else coo_array(wanted), comment="a comment", symmetry="AUTO", precision=17)
    assert shape in path.read_text().splitlines()[0]
    found = read_matrix(path)
    assert isinstance(found, np.ndarray) == dense
    np.testing.assert_array_equal(found if dense else found.toarray(), wanted)


def test_matrix_market_by_hand(tmp_path):
    """Blank lines and comments before the sizes and between the entries, whole numbers, no entry at all."""
    text = "coordinate integer general\n%\n\n  % 9 9 9\n2 2 2\n1 2 5\n% here\n2 1 -7"
    assert read_matrix(market(tmp_path, text)).toarray().tolist() == [[0.0, 5.0], [-7.0, 0.0]]
    assert read_matrix(market(tmp_path, "coordinate real general\n2 2 0\n")).toarray().tolist() == [[0.0] * 2] * 2
    assert read_matrix(market(tmp_path, "coordinate real general\n2 2 0")).toarray().tolist() == [[0.0] * 2] * 2
    assert read_matrix(market(tmp_path, "array double general\n1 1\n5\n")).tolist() == [[5.0]]
    assert read_matrix(market(tmp_path, "array real general\n2 2\n1\n2\n3\n4\n")).tolist() == [[1.0, 3.0], [2.0, 4.0]]
    half = read_matrix(market(tmp_path, "array real symmetric\n3 3\n1\n2\n3\n4\n5\n6\n"))
    assert half.tolist() == [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]
    half = read_matrix(market(tmp_path, "coordinate real symmetric\n3 3 4\n1 1 1\n2 1 2\n3 3 3\n3 1 4\n"))
    assert half.toarray().tolist() == [[1.0, 2.0, 4.0], [2.0, 0.0, 0.0], [4.0, 0.0, 3.0]]


CLAIMS = {
    "complex": ("coordinate complex general\n1 1 1\n1 1 1 1\n", "it is complex and general; allowed: real or integer"),
    "skew": ("coordinate real skew-symmetric\n2 2 1\n2 1 1\n", "it is real and skew-symmetric; allowed: "),
    "not square": ("coordinate real general\n1 2 1\n1 1 1\n", "it claims 1 x 2 with 1 entries in 58 bytes"),
    "no rows": ("coordinate real general\n0 0 0\n", "it claims 0 x 0 with 0 entries in "),
    "more entries than bytes": (
        "coordinate real general\n2 2 9\n1 1 1\n",
        "it claims 2 x 2 with 9 entries in 58",
    ),
    "too many rows": ("array real general\n11181 11181\n1\n", "it claims 11181 x 11181 with "),
    "too many rows of a sparse one": ("coordinate real general\n41666667 41666667 1\n1 1 1\n", "it claims 41666667 x"),
    "fewer entries": ("coordinate real general\n2 2 2\n1 1 1\n", "it holds other entries than the 2 of 2 rows that it"),
    "two numbers an entry": ("coordinate real general\n2 2 1\n1 1\n", "it holds other entries than the 1 of 2 rows"),
    "half a row": ("coordinate real general\n2 2 1\n1.5 1 1\n", "it holds other entries"),
    "row 0": ("coordinate real general\n2 2 1\n0 1 1\n", "it holds other entries"),
    "a row beyond": ("coordinate real general\n2 2 1\n1 3 1\n", "it holds other entries"),
    "a full one with less": ("array real general\n2 2\n1\n2\n3\n", "it holds other entries than the 4 that it claims"),
    "half a full one with more": ("array real symmetric\n2 2\n1\n2\n3\n4\n", "other entries than the 3 that it claims"),
    "a full one in rows": ("array real general\n2 2\n1 2\n3 4\n", "it holds other entries than the 4 that it claims"),
    "a word": ("array real general\n1 1\nx\n", "could not convert"),
    "nothing": ("", "Line 1: "),
}


@pytest.mark.parametrize("case", CLAIMS)
def test_a_matrix_that_is_not_what_it_claims_is_refused(case, tmp_path):
    """No number of it is believed before it is there."""
    text, line = CLAIMS[case]
    told = refused(read_matrix, market(tmp_path, text))
    assert told.startswith("can't be read as a matrix: ")
    assert line in told


def test_the_largest_matrix_that_may_be(tmp_path, monkeypatch):
    """The bound is one of bytes: 8 for an entry of a full matrix, 24 for a row and for an entry of a sparse one."""
    full, sparse = "array real general\n3 3\n" + "1\n" * 9, "coordinate real general\n3 3 1\n1 1 1\n"
    content = {text: market(tmp_path, text).read_bytes() for text in (full, sparse)}
    for text, bytes_needed in ((full, 72), (sparse, 96)):
        monkeypatch.setattr(archives, "LARGEST", bytes_needed)
        archives._matrix_market(content[text])
        monkeypatch.setattr(archives, "LARGEST", bytes_needed - 1)
        with pytest.raises(ValueError, match="it claims 3 x 3"):
            archives._matrix_market(content[text])


def test_an_array_of_numpy(tmp_path):
    """As it was saved; one of objects is refused, in one line."""
    np.save(tmp_path / "K.npy", K)
    np.testing.assert_array_equal(read_matrix(tmp_path / "K.npy"), K)
    buffer = io.BytesIO()
    np.save(buffer, np.array([None]), allow_pickle=True)
    (tmp_path / "K.npy").write_bytes(buffer.getvalue())
    assert refused(read_matrix, tmp_path / "K.npy").startswith("can't be read as a matrix: an array holds objects")


def test_a_stiffness_in_place_of_a_matrix_is_told_how_to_be_stated(tmp_path):
    """A mass of 2 kg on 40 kN/m is two numbers for an engineer; here a stiffness is the file of a matrix."""
    text = template("mass").replace('frequencies = "10 Hz"', 'stiffness = "40 kN/m"')
    (tmp_path / "stiff.toml").write_text(text)
    with pytest.raises(ParameterError, match=r"'40 kN/m' is no file: .*frequencies = sqrt\(k / m\)"):
        read_machine(tmp_path / "stiff.toml")
