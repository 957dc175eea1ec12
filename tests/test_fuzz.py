"""Damaged inputs of every kind, drawn by Hypothesis: an answer or one line, never another error.

A hundred of each kind by default, and 400 in the slow tests; ``CHAOSGYM_FUZZ=2000`` asks for more.
"""

import io
import json
import os
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chaosgym.classifier.storage import read_model
from chaosgym.control.policies import load_policy
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.design.brief import read_brief
from chaosgym.design.brief import template as brief_template
from chaosgym.errors import ChaosgymError
from chaosgym.machines.machine_file import machine_class, template
from chaosgym.machines.modal_machine.archives import read_archive, read_matrix
from chaosgym.parquet import parquet_of
from chaosgym.recordings.read import read_recording
from chaosgym.sweeps import read_sweep
from chaosgym.sweeps.info import dataset_info

MANY = int(os.environ.get("CHAOSGYM_FUZZ", "400"))
"""Examples of each kind in the slow tests."""

HERE = Path(__file__).parents[1]

WORDS = (
    *("-1", "0", "1e300", "-1e300", "1e-320", "nan", "inf", "9" * 4300, "9" * 400, "[" * 3000, "[]", "{}", "true"),
    *('""', '"a"', '"\\u0000"', '"../.."', '"/dev/zero"', '"0 Hz"', '"1e300 m/N"', '"-1 kg"', '"1, 2, 3 N"', "[[1]]"),
    *("1979-05-27", '"%"', '"1 "', '" mm"', '"1 rad"', '"5 N m"', "[1, [2]]", '"1e309 N"', '["a", 1]'),
)


def _replaced(text: str) -> st.SearchStrategy[bytes]:
    """A text with values replaced by hostile ones, lines left out or doubled, and bytes changed."""
    lines = text.split("\n")
    stated = [place for place, line in enumerate(lines) if "=" in line and not line.startswith("#")]

    @st.composite
    def draw(data: st.DrawFn) -> bytes:
        changed = list(lines)
        for _ in range(data(st.integers(1, 3))):
            place, how = data(st.sampled_from(stated)), data(st.integers(0, 9))
            key = lines[place].partition("=")[0]
            if how < 7:
                changed[place] = f"{key}= {data(st.sampled_from(WORDS))}"
            else:
                changed[place] = "" if how == 7 else lines[place] + "\n" + lines[place] if how == 8 else "\0"
        return "\n".join(changed).encode()

    return draw()


def _damaged(content: bytes) -> st.SearchStrategy[bytes]:
    """Bytes that are cut, or some of which are changed."""
    change = st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255))

    def spoil(changes: list[tuple[int, int]], end: int) -> bytes:
        spoiled = bytearray(content[: end or len(content)])
        for place, byte in changes:
            if place < len(spoiled):
                spoiled[place] = byte
        return bytes(spoiled)

    ends = st.one_of(st.just(0), st.integers(0, len(content)))
    return st.builds(spoil, st.lists(change, max_size=6), ends)


def _saved(save, *values, **named) -> bytes:
    buffer = io.BytesIO()
    save(buffer, *values, **named)
    return buffer.getvalue()


MASS, STIFFNESS = np.diag([1.0, 2.0]), np.array([[3e3, -1e3], [-1e3, 1e3]])
KINDS_OF_MASS = [MASS + 0j, MASS > 0, MASS.astype("U"), MASS.astype("f4"), MASS.astype("i8"), -MASS, 1e300 * MASS]
SHAPES = [
    np.zeros((0, 0)),
    np.float64(5.0),
    np.full((2, 2), np.nan),
    np.arange(3),
    np.zeros((2, 2)),
    np.array(["a", "b"]),
]
ARRAYS = st.sampled_from([MASS, STIFFNESS, *KINDS_OF_MASS, *SHAPES])
NPZ = st.one_of(
    _damaged(_saved(np.savez, M=MASS, K=STIFFNESS, names=["motor", "tip"])),
    st.builds(
        lambda given: _saved(np.savez, **given),
        st.dictionaries(st.sampled_from(["M", "K", "C", "base", "names"]), ARRAYS, min_size=1),
    ),
)
MTX = "%%MatrixMarket matrix {} {} symmetric\n2 2 {}\n1 1 {}\n2 1 -1e3\n2 2 1e3\n"
MARKET = st.one_of(
    _damaged(MTX.format("coordinate", "real", 3, "3e3").encode()),
    st.builds(
        lambda *words: MTX.format(*words).encode(),
        st.sampled_from(["coordinate", "array"]),
        st.sampled_from(["real", "complex", "pattern", "integer"]),
        st.sampled_from(["3", "99999999999", "-1", "2"]),
        st.sampled_from(["3e3", "nan", "1e400", "x", "3e3 1"]),
    ),
)
PARTS = template().index("frequencies ="), template().index("[joint]")
MESH = template()[: PARTS[0]] + '{}\nmodes = 2\ndamping_ratios = "1 %"\n' + template()[PARTS[1] :]
BY_ARCHIVE = MESH.format('matrices = "m.npz"')
BY_MARKET = MESH.format('mass = "m.mtx"\nstiffness = "m.mtx"\ndegrees_of_freedom = { tip = 1, motor = 0 }')
RECORD = "time [s];force [N]\n" + "".join(f"{k};{np.sin(k):.4f}\n" for k in range(80))
POLICY = shipped_folder("chaosgym/ImpactBeamTolerance-v1")
DATA = HERE / "datasets" / "impact-beam" / "sample" / "sweep.parquet"


def _machine(folder, content):
    (folder / "m.toml").write_bytes(content)
    machine_class(folder / "m.toml")()


def _by_archive(folder, content):
    (folder / "m.npz").write_bytes(content)
    read_archive(folder / "m.npz")
    _machine(folder, BY_ARCHIVE.encode())


def _by_market(folder, content):
    (folder / "m.mtx").write_bytes(content)
    read_matrix(folder / "m.mtx")
    _machine(folder, BY_MARKET.encode())


def _brief(folder, content):
    (folder / "brief.toml").write_bytes(content)
    read_brief(folder / "brief.toml")


def _recording(folder, content):
    (folder / "r").write_bytes(content)
    read_recording(folder / "r")


def _classifier(folder, content):
    (folder / "c.npz").write_bytes(content)
    read_model(folder / "c.npz")


def _policy(folder, content):
    (folder / "policy.json").write_bytes(content)
    (folder / "weights.npz").write_bytes((POLICY / "weights.npz").read_bytes())
    load_policy(folder)


def _plan(folder, content):
    (folder / "plan.json").write_bytes(content)
    dataset_info(folder)


def _dataset(folder, content):
    (folder / "sweep.parquet").write_bytes(content)
    read_sweep(folder)


def _checkpoint(folder, content):
    from agents.training import CHECKPOINT, load_checkpoint  # torch and stable-baselines3 take a second

    (folder / CHECKPOINT).write_bytes(content)
    load_checkpoint(folder, None, None)


def _zip(folder, content):
    (folder / "a.npz").write_bytes(content)
    read_archive(folder / "a.npz")


def _plan_text() -> str:
    return json.dumps(json.loads(pq.read_schema(DATA).metadata[b"chaosgym"]), indent=0).replace(": ", " = ")


def _small_dataset() -> bytes:
    return _saved(lambda buffer: pq.write_table(pq.read_table(DATA).slice(0, 3), buffer))


def _classifier_bytes() -> bytes:
    return next((HERE / "src" / "chaosgym" / "weights").glob("*.npz")).read_bytes()


def _plans() -> st.SearchStrategy[bytes]:
    return _replaced(_plan_text()).map(lambda text: text.replace(b" = ", b": ").replace(b"= ", b": "))


def _bombs() -> st.SearchStrategy[bytes]:
    def bomb(size: int, name: str, method: int) -> bytes:
        return _saved(lambda buffer: _pack(buffer, name, size, method))

    return st.builds(
        bomb, st.sampled_from([0, 10, 10**6]), st.sampled_from(["M.npy", "K", "x"]), st.sampled_from([0, 8, 12, 14])
    )


def _pack(buffer, name, size, method):
    with zipfile.ZipFile(buffer, "w", method) as archive:
        archive.writestr(name, bytes(size))


KINDS = {
    "machines": (lambda: _replaced(template()), _machine),
    "mechanisms": (lambda: _replaced(template("compressor")), _machine),
    "archives of matrices": (lambda: NPZ, _by_archive),
    "zips": (_bombs, _zip),
    "Matrix Market": (lambda: MARKET, _by_market),
    "briefs": (lambda: _replaced(brief_template("impact-beam")), _brief),
    "recordings": (lambda: st.one_of(_damaged(RECORD.encode()), st.binary(max_size=300)), _recording),
    "arrays as recordings": (lambda: _damaged(_saved(np.save, np.arange(40.0))), _recording),
    "policies": (lambda: _damaged((POLICY / "policy.json").read_bytes()), _policy),
    "classifiers": (lambda: _damaged(_classifier_bytes()[:60_000]), _classifier),
    "plans": (_plans, _plan),
    "datasets": (lambda: _damaged(_small_dataset()), _dataset),
    "checkpoints": (lambda: st.binary(max_size=200), _checkpoint),
}


def _fuzz(kind: str, folder: Path, examples: int) -> None:
    strategy, read = KINDS[kind]

    @settings(
        max_examples=examples, deadline=10_000, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
    )
    @given(strategy())
    def attack(content: bytes) -> None:
        said = "an answer"
        try:
            read(folder, content)
        except ChaosgymError as error:
            said = str(error)
        assert 0 < len(said) < 1000, said
        assert "\n" not in said

    attack()


@pytest.mark.parametrize("kind", KINDS)
def test_a_hundred_damaged_inputs(kind, tmp_path, monkeypatch):
    """Each ends in an answer or in one line."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    _fuzz(kind, tmp_path, 100)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_damaged_inputs(kind, tmp_path, monkeypatch):
    """As the test above."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    _fuzz(kind, tmp_path, MANY)


def test_a_damaged_footer_does_not_end_the_process():
    """Levels of a column that count one too many: Parquet's reader throws where no exception may pass."""
    content = _saved(lambda buffer: pq.write_table(pa.table({"force": [[1.0], [], None]}), buffer))
    said = set()
    for place in range(len(content) - pq.read_metadata(io.BytesIO(content)).serialized_size - 8, len(content)):
        for value in (0x19, 0x26, 0x36, 0x46):
            damaged = content[:place] + bytes([value]) + content[place + 1 :]
            try:
                parquet_of(io.BytesIO(damaged))
            except ValueError as error:
                said.add(str(error))
    assert any("histogram size mismatch" in message for message in said)
