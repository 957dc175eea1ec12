"""``classify`` and ``train-classifier`` on the command line: parameters, measured records, batches, a live monitor."""

import io
import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from chaosgym.cli import main
from chaosgym.machines import THESIS_IMPACT_BEAM
from chaosgym.simulation import simulate
from tests.classifier.made_up import settled

KEYS = {
    "response_type",
    "probabilities",
    "nature",
    "nature_probabilities",
    "confidence",
    "abstained",
    "reason",
}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A classifier of the made-up sweep, on disk."""
    from chaosgym.classifier.train import train_classifier
    from tests.classifier.made_up import made_up_sweep

    folder = tmp_path_factory.mktemp("model")
    train_classifier(made_up_sweep(), seed=1, curve=False).save(folder)
    return str(folder / "classifier.npz")


def run(*arguments, stdin=""):
    """Exit code, standard output and standard error of ``chaosgym classify impact-beam``, run in this process."""
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["chaosgym", "classify", "impact-beam", *map(str, arguments)])
        patch.setattr(sys, "stdin", io.StringIO(stdin))
        try:
            main()
        except SystemExit as end:
            code = end.code
    return code, out.getvalue(), err.getvalue()


def lines_of(record):
    """Peaks, one a line."""
    return "\n".join(f"{peak:.4f}" for peak in record) + "\n"


def test_one_run_from_standard_input(model):
    """A chaotic record is called chaotic, with every key of the answer, and probabilities that sum to one."""
    code, out, err = run("--peaks", "-", "--model", model, "--json", stdin=lines_of(settled(3.9, 40)))
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert set(answer) >= KEYS
    assert answer["learned_nature"] == "chaotic"
    assert set(answer["probabilities"]) == {"I", "II", "III"}
    for name in ("probabilities", "nature_probabilities"):
        assert sum(answer[name].values()) == pytest.approx(1.0)


def test_one_run_a_column(model, tmp_path):
    """Two columns of unequal length are two runs; 20 cycles are too few for the verdict, not for the classifier."""
    first, second = settled(3.2, 30), settled(3.9, 20)
    rows = [f"{a},{b}" for a, b in zip(first, second, strict=False)] + [f"{a}," for a in first[20:]]
    path = tmp_path / "runs.csv"
    path.write_text("calm,wild\n" + "\n".join(rows) + "\n")
    code, out, _ = run("--peaks", path, "--model", model, "--json")
    assert code == 0
    answers = json.loads(out)["runs"]
    assert (answers["calm"]["nature"], answers["calm"]["period"]) == ("periodic", 2)
    assert (answers["calm"]["learned_nature"], answers["wild"]["learned_nature"]) == ("periodic", "chaotic")
    assert answers["wild"]["nature"] == "undetermined"


def test_a_fresh_process_answers_as_compiled_kernels_do(model):
    """One question to a new process, which compiles nothing, has the answer of the compiled kernels."""
    for arguments, stdin in ((("--frequency-hz", "20"), ""), (("--peaks", "-"), lines_of(settled(3.9, 40)))):
        options = (*arguments, "--model", model, "--json")
        command = [sys.executable, "-m", "chaosgym", "classify", "impact-beam", *options]
        alone = subprocess.run(command, input=stdin, capture_output=True, text=True, check=True)
        here, there = json.loads(run(*options, stdin=stdin)[1]), json.loads(alone.stdout)
        assert here["response_type"] == there["response_type"]
        assert here["confidence"] == pytest.approx(there["confidence"], rel=1e-4)


def test_monitor_prints_a_verdict_each_cycle(model):
    """One line a cycle: waiting up to the seventh, verdicts from the eighth on."""
    code, out, _ = run("--follow", "--model", model, "--json", stdin=lines_of(settled(3.9, 12)))
    answers = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [answer["cycle"] for answer in answers] == list(range(1, 13))
    assert all(answer["abstained"] for answer in answers[:7])
    assert "1 more cycle" in answers[6]["reason"]
    assert answers[-1]["nature"] == "chaotic"


def test_monitor_answers_before_the_next_peak_comes(model):
    """The verdict of a cycle is printed while standard input is still open."""
    command = [sys.executable, "-m", "chaosgym", "classify", "impact-beam", "--follow", "--model", model]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        for cycle, peak in enumerate(settled(3.2, 9), start=1):
            process.stdin.write(f"{peak}\n")
            process.stdin.flush()
            assert process.stdout.readline().split()[0] == str(cycle)
        process.stdin.close()


def test_batch_keeps_the_columns_and_adds_the_answers(model, tmp_path):
    """Every row of a Parquet file gets its answer; a row outside the range has none."""
    table = pa.table({"name": ["a", "b", "c"], "excitation_frequency": [8.0, 29.0, 300.0], "clearance": [5e-5] * 3})
    pq.write_table(table, tmp_path / "in.parquet")
    code, out, _ = run("--batch", tmp_path / "in.parquet", "--out", tmp_path / "out.parquet", "--model", model)
    assert code == 0
    answers = pq.read_table(tmp_path / "out.parquet")
    assert answers.column("name").to_pylist() == ["a", "b", "c"]
    assert answers.column("response_type").to_pylist()[1:] == ["III", None]
    assert answers.column("abstained").to_pylist()[2]
    assert "3 rows judged" in out


def test_batch_of_records(model, tmp_path):
    """A column of lists is taken as records."""
    records = [settled(3.9, 30).tolist(), settled(3.2, 50).tolist()]
    pq.write_table(pa.table({"peak_force": records}), tmp_path / "in.parquet")
    code, _, _ = run("--batch", tmp_path / "in.parquet", "--out", tmp_path / "out.parquet", "--model", model)
    assert code == 0
    assert pq.read_table(tmp_path / "out.parquet").column("nature").to_pylist() == ["chaotic", "periodic"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("31\n32\n33\n", "3 cycles; allowed: 8 or more"),
        ("31\n" * 9 + "nan\n", "'nan' is not a finite number"),
        ("31\n" * 9 + "-2\n", "a negative force"),
        ("31\n" * 9 + "abc\n", "'abc' is not a finite number"),
        ("", "holds no numbers"),
        ("a,a\n1,2\n", "two columns alike"),
    ],
)
def test_bad_records_end_in_one_line(model, text, message):
    """No traceback, nothing on standard output, exit code 2."""
    code, out, err = run("--peaks", "-", "--model", model, stdin=text)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1


def test_bad_options_end_in_one_line(model, tmp_path):
    """Options that contradict each other, missing files and missing columns are named."""
    pq.write_table(pa.table({"clearance": [1e-4]}), tmp_path / "in.parquet")
    (tmp_path / "words.parquet").write_text("no parquet")
    out = ("--out", tmp_path / "out.parquet", "--model", model)
    for arguments, message in (
        (("--peaks", "nowhere.csv"), "can't be read"),
        (("--peaks", "-", "--follow"), "exclude each other"),
        (("--batch", tmp_path / "in.parquet"), "belong together"),
        (("--batch", tmp_path / "in.parquet", *out), "no column excitation_frequency"),
        (("--batch", tmp_path / "words.parquet", *out), "can't be read as Parquet"),
        (("--sensor-error", "3"), "belongs to --peaks, --series or --follow"),
    ):
        code, shown, err = run(*arguments)
        assert (code, shown) == (2, "")
        assert message in err
        assert len(err.strip().splitlines()) == 1


def test_wrong_units_are_suspected(model):
    """Peaks of 10^6 N are answered by an abstention that suspects the unit."""
    code, out, _ = run("--peaks", "-", "--model", model, "--json", stdin=lines_of(1e6 * settled(3.9, 20) / 40.0))
    answer = json.loads(out)
    assert code == 0
    assert answer["abstained"]
    assert answer["response_type"] is answer["learned_nature"] is None
    assert "wrong units suspected" in answer["reason"]


def test_shipped_classifier_judges_a_simulated_record():
    """Peaks of the thesis' chaotic point, read by a 3 N sensor, are chaotic to the shipped classifier."""
    peaks = simulate(THESIS_IMPACT_BEAM, 50, transient=200).peak_force[:, 0]
    noisy = peaks + np.random.default_rng(0).uniform(-3.0, 3.0, 50)
    code, out, _ = run("--peaks", "-", "--sensor-error", "3", "--json", stdin=lines_of(noisy))
    assert code == 0
    assert json.loads(out)["nature"] == "chaotic"
