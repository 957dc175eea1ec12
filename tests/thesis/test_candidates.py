"""Candidates that a search found are kept, built and judged as any beam."""

import json

import pytest

from chaosgym.errors import DatasetError, ParameterError
from chaosgym.machines.impact_beam.modes import static_tip_deflection
from tests.cli.run import run
from thesis.scorecard.candidates import candidates, read_candidate
from thesis.scorecard.search_space import STATIC_TIP_DEFLECTION
from thesis.statements import read_comparisons, read_measured


def test_every_candidate_has_the_printed_static_deflection():
    """3.175 mm under 8.9 N, as of every beam of a search (3.5.1)."""
    assert {"former", "A", "B"} <= set(candidates())
    for beam in (read_candidate(name).machine for name in candidates() if name != "gravity"):
        assert static_tip_deflection(beam) == pytest.approx(STATIC_TIP_DEFLECTION, rel=1e-4)


@pytest.mark.parametrize(
    ("text", "error", "told"),
    [
        ("{", DatasetError, "holds no candidate"),
        ("[]", DatasetError, "holds no candidate"),
        ('{"parameters": {"lenth": 1.0}}', DatasetError, "lenth is no parameter"),
        ('{"parameters": {"length": -1.0}}', ParameterError, "length = -1"),
        (" " * 1_000_001, DatasetError, "more than 1000000 bytes"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, text, error, told):
    """Damaged, of another kind, with an unknown or an impossible parameter, or far too large."""
    file = tmp_path / "beam.json"
    file.write_text(text)
    with pytest.raises(error, match=told):
        read_candidate(str(file))


def test_a_file_of_a_search_and_a_name_are_both_read(tmp_path):
    """The result of a search holds the parameters of its best candidate."""
    file = tmp_path / "result.json"
    file.write_text(json.dumps({"parameters": dict(candidates()["A"]["parameters"])}))
    assert read_candidate(str(file)) == read_candidate("A")
    code, _, err = run("scorecard", "--candidate", "Z", module="thesis")
    assert code == 2
    assert "neither a file nor one of former, A, B" in err


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--basin", "x", "--machine", "slider-crank"), "begins no name of a structure"),
        (("--basin", "gravity"), "--basin goes with one --machine"),
        (("--candidate", "gravity", "--machine", "impact-beam"), "gravity is of --machine slider-crank alone"),
        (("--basin", "soft", "--machine", "impact-beam", "--candidate", "A"), "--basin goes with one --machine"),
    ],
)
def test_a_structure_that_is_none_is_refused(options, told):
    """Before anything is computed, in one line."""
    code, out, err = run("scorecard", *options, module="thesis")
    assert (code, out) == (2, "")
    assert told in err


def test_what_was_measured_is_judged_apart():
    """No measured statement is among those that a search may follow."""
    measured = {one.id for one in read_measured().compared}
    assert {"IBS-047", "IBS-049", "IBS-053", "IBS-054", "IBS-056", "IBS-058"} <= measured
    assert sum(name.startswith("SSC") for name in measured) == 16
    assert not measured & {one.id for one in read_comparisons().compared}
    assert all(one.statement.kinds == ("experiment",) for one in read_measured().compared)
