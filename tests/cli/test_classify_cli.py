"""``classify`` on the command line: parameters, measured records, batches."""

import io
import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from chaosgym.cli import main
from chaosgym.machines.machine_file import template
from chaosgym.simulation import simulate
from tests.classifier.made_up import settled
from tests.diagnosis.machine_files import written
from tests.machines.test_initial_state import JUMP
from tests.plain_modes import PLAIN_BEAM

KEYS = {
    "irregular",
    "irregular_probability",
    "amplitude",
    "nature",
    "nature_probabilities",
    "period",
    "abstained",
    "reason",
    "warning",
}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A classifier of the made-up sweep, on disk."""
    from chaosgym.classifier.train import train_classifier
    from tests.classifier.made_up import made_up_sweep

    folder = tmp_path_factory.mktemp("model")
    train_classifier(made_up_sweep(), seed=1).save(folder)
    return str(folder / "classifier.npz")


def run(*arguments, stdin="", machine="impact-beam"):
    """Exit code, standard output and standard error of ``chaosgym classify``, run in this process."""
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["chaosgym", "classify", str(machine), *map(str, arguments)])
        patch.setattr(sys, "stdin", io.StringIO(stdin))
        try:
            main()
        except SystemExit as end:
            code = end.code
    return code, out.getvalue(), err.getvalue()


def test_no_machine_is_one_line():
    """Without a word more, the command says which machines there are."""
    result = subprocess.run([sys.executable, "-m", "chaosgym", "classify"], capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (
        2,
        "Error: Missing argument '{impact-beam|slider-crank|FILE.toml}'.\n",
    )


def lines_of(record):
    """Peaks, one a line."""
    return "\n".join(f"{peak:.4f}" for peak in record) + "\n"


def test_one_run_from_standard_input(model):
    """A chaotic record is called chaotic, with every key of the answer, and probabilities that sum to one."""
    options = ("-", "--sensor-error", "1", "--model", model, "--json")
    code, out, _ = run(*options, stdin=lines_of(settled(3.9, 400)))
    assert code == 0
    answer = json.loads(out)
    assert set(answer) >= KEYS
    assert answer["nature"] == "chaotic"
    assert answer["irregular"] is True
    assert sum(answer["nature_probabilities"].values()) == pytest.approx(1.0)


def test_one_run_a_column(model, tmp_path):
    """Two columns of unequal length are two runs; 20 cycles are too few for a verdict, and then no nature is told."""
    first, second = settled(3.2, 30), settled(3.9, 20)
    rows = [f"{a},{b}" for a, b in zip(first, second, strict=False)] + [f"{a}," for a in first[20:]]
    path = tmp_path / "runs.csv"
    path.write_text("calm,wild\n" + "\n".join(rows) + "\n")
    code, out, _ = run(path, "--model", model, "--json")
    assert code == 0
    answers = json.loads(out)["runs"]
    assert (answers["calm"]["nature"], answers["calm"]["period"]) == ("periodic", 2)
    assert answers["calm"]["plausible"] == ["periodic"]
    assert (answers["wild"]["nature"], answers["wild"]["plausible"]) == ("undetermined", [])


def test_a_fresh_process_answers_as_compiled_kernels_do(model):
    """One question to a new process, which compiles nothing, has the answer of the compiled kernels."""
    for arguments, stdin in ((("--budget-us", "0"), ""), (("-",), lines_of(settled(3.2, 40)))):
        options = (*arguments, "--model", model, "--json")
        command = [sys.executable, "-m", "chaosgym", "classify", "impact-beam", *options]
        alone = subprocess.run(command, input=stdin, capture_output=True, text=True, check=True)
        here, there = json.loads(run(*options, stdin=stdin)[1]), json.loads(alone.stdout)
        assert here["nature_probabilities"].keys() == there["nature_probabilities"].keys()
        for name, chance in here["nature_probabilities"].items():
            assert chance == pytest.approx(there["nature_probabilities"][name], rel=1e-4)


def test_a_record_of_a_machine_from_a_file_is_refused_with_what_judges_it(tmp_path):
    """In a new process too: none has learned such records, and no setting of the computer is blamed."""
    (tmp_path / "own.toml").write_text(template(), encoding="utf-8")
    command = [sys.executable, "-m", "chaosgym", "classify", tmp_path / "own.toml", "-"]
    done = subprocess.run(command, input=lines_of(settled(3.2, 40)), capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert "`chaosgym judge` judges them without one" in done.stderr


def test_a_machine_is_answered_with_its_proof():
    """The thesis' periodic point: which stage spoke, that it is proven, its period and the time that it took."""
    code, out, err = run("--frequency-hz", "19", "--clearance-mm", "0.127", "--json")
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert (answer["nature"], answer["proven"], answer["stage"], answer["period"]) == (
        "periodic",
        True,
        "certificate",
        1,
    )
    assert answer["microseconds"] >= answer["nature_microseconds"] > 0.0
    assert answer["response_type"] in answer["type_probabilities"]
    _, text, _ = run("--frequency-hz", "19", "--clearance-mm", "0.127", "--nature-only")
    assert "proven by certificate" in text
    assert "Type" not in text


def test_a_budget_of_nothing_is_an_answer_from_parameters():
    """Nothing is simulated, so there is a nature and no type."""
    answer = json.loads(run("--budget-us", "0", "--frequency-hz", "5", "--json")[1])
    assert (answer["stage"], answer["cycles"], answer["response_type"]) == ("parameters", 0, None)
    assert answer["nature"] == "periodic"


def test_batch_keeps_the_columns_and_adds_the_answers(tmp_path):
    """Every row of a Parquet file gets the answer of its machine; one that can't be built gets the reason."""
    speeds = [10.0, 30.0, 1e9]
    table = pa.table({"name": ["a", "b", "c"], "excitation_frequency": speeds, "clearance": [1.27e-4] * 3})
    for field in ("length", "damping_ratio", "contact_damping"):
        table = table.append_column(field, pa.array([getattr(PLAIN_BEAM, field)] * 3))
    pq.write_table(table, tmp_path / "in.parquet")
    code, out, _ = run("--batch", tmp_path / "in.parquet", "--out", tmp_path / "out.parquet")
    assert code == 0
    answers = pq.read_table(tmp_path / "out.parquet")
    assert answers.column("name").to_pylist() == ["a", "b", "c"]
    assert answers.column("nature").to_pylist() == ["periodic", "chaotic", None]
    assert answers.column("proven").to_pylist() == [True, False, None]
    assert answers.column("response_type").to_pylist()[1:] == ["III", None]
    assert "excitation_frequency = 1e+09" in answers.column("reason").to_pylist()[2]
    assert "3 rows judged, 1 of them without an answer" in out


def test_batch_of_a_machine_of_ones_own(tmp_path):
    """Rows of a machine without a classifier are judged by the general one, which knows nothing from parameters."""
    gears = Path(__file__).parents[2] / "docs" / "machines" / "kahraman-singh-1990.toml"
    pq.write_table(pa.table({"clearance": [1e-4, 1.2e-4]}), tmp_path / "in.parquet")
    given = ("--batch", tmp_path / "in.parquet", "--out")
    assert run(*given, tmp_path / "out.parquet", machine=gears)[0] == 0
    assert pq.read_table(tmp_path / "out.parquet").column("proven").to_pylist() == [True, True]
    code, _, err = run(*given, tmp_path / "none.parquet", "--budget-us", "0", machine=gears)
    assert code == 2
    assert "from parameters alone" in err


def test_batch_from_parameters_alone(model, tmp_path):
    """A budget of nothing judges all rows at once; a row outside the range has no answer."""
    table = pa.table({"excitation_frequency": [8.0, 29.0, 300.0], "clearance": [5e-5, 1.5e-4, 5e-5]})
    pq.write_table(table, tmp_path / "in.parquet")
    files = ("--batch", tmp_path / "in.parquet", "--out", tmp_path / "out.parquet")
    assert run(*files, "--budget-us", "0", "--model", model)[0] == 0
    answers = pq.read_table(tmp_path / "out.parquet")
    assert answers.column("nature").to_pylist() == ["periodic", "chaotic", None]
    assert answers.column("abstained").to_pylist() == [False, False, True]


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
    code, out, err = run("-", "--model", model, stdin=text)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1


def test_bad_options_end_in_one_line(model, tmp_path):
    """Options that contradict each other, missing files and missing columns are named."""
    pq.write_table(pa.table({"clearance": [1e-4]}), tmp_path / "in.parquet")
    (tmp_path / "words.parquet").write_text("no parquet")
    out = ("--out", tmp_path / "out.parquet", "--model", model)
    for arguments, message in (
        (("nowhere.csv",), "can't be read"),
        (("-", "--batch", tmp_path / "in.parquet", *out), "FILE goes without --batch"),
        (("--batch", tmp_path / "in.parquet"), "belong together"),
        (("--batch", tmp_path / "in.parquet", *out), "no column excitation_frequency"),
        (("--batch", tmp_path / "words.parquet", *out), "can't be read as Parquet"),
        (("--sensor-error", "3"), "options of a recording need one: classify impact-beam FILE"),
        (("-", "--budget-us", "9"), "FILE goes without --batch"),
    ):
        code, shown, err = run(*arguments)
        assert (code, shown) == (2, "")
        assert message in err
        assert len(err.strip().splitlines()) == 1


def test_wrong_units_are_suspected(model):
    """Peaks of 10^6 N are answered by an abstention that suspects the unit."""
    code, out, _ = run("-", "--model", model, "--json", stdin=lines_of(1e6 * settled(3.9, 20) / 40.0))
    answer = json.loads(out)
    assert code == 0
    assert answer["abstained"]
    assert answer["irregular"] is None
    assert "wrong units suspected" in answer["reason"]


def test_shipped_classifier_judges_a_simulated_record():
    """To a 3 N sensor the thesis' chaotic point is irregular beyond its error, and the one at 19 Hz is not."""
    for frequency, irregular in ((30.0, True), (19.0, False)):
        peaks = simulate(PLAIN_BEAM.at(frequency), 50, transient=200).peak_force[:, 0]
        noisy = peaks + np.random.default_rng(0).uniform(-3.0, 3.0, 50)
        code, out, _ = run("-", "--sensor-error", "3", "--json", stdin=lines_of(noisy))
        assert code == 0
        answer = json.loads(out)
        assert answer["irregular"] is irregular
        assert answer["nature"] == ("undetermined" if irregular else "periodic")


def test_a_type_from_rest_says_so(tmp_path):
    """Beside the jump of a gap flies a rattle that rest does not reach: the type is told as one from rest alone."""
    _, told, _ = run(machine=written(tmp_path, JUMP))
    assert "Type I from rest, periodic, period 1" in told
    assert "judged by runs from rest alone; `chaosgym diagnose --types` looks for other motions" in told
