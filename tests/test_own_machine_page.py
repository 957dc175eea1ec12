"""The page on one's own machine works as it stands, from the matrices to the report and the agent."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import pyuff
from click.testing import CliRunner

from chaosgym import read_machine
from chaosgym.cli import app
from chaosgym.machines.machine_file import template

PAGE = (Path(__file__).parent.parent / "docs" / "own-machine.md").read_text()


def hammer():
    """Responses of the template to a hammer at its tip, with 1 % noise, in hammer.uff; returns its machine."""
    Path("example.toml").write_text(template())
    machine = read_machine("example.toml")
    rates, tip = 2.0 * np.pi * machine.natural_frequencies, machine.modes.shape("tip")
    hertz = np.arange(0.0, 400.0, 0.1)
    omega = 2.0 * np.pi * hertz[:, None]
    receptance = tip / (rates**2 - omega**2 + 1j * omega * np.diag(machine.modes.damping))
    noise = np.random.default_rng(0)
    about = {"type": 58, "func_type": 4, "binary": 0, "abscissa_spacing": 1, "id1": "hammer", "x": hertz}
    kinds = {"abscissa_spec_data_type": 18, "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13}
    names = {"rsp_ent_name": "NONE", "ref_ent_name": "NONE", "rsp_dir": 2, "ref_dir": 2, "ref_node": 3}
    sets = []
    for node, point in ((3, "tip"), (7, "motor")):
        response = -(omega[:, 0] ** 2) * (receptance @ machine.modes.shape(point))
        response *= 1.0 + 0.01 * noise.normal(size=len(hertz))
        sets.append({**about, **kinds, **names, "rsp_node": node, "data": response})
    pyuff.UFF("hammer.uff").write_sets(sets, mode="overwrite")
    return machine


def shorter(line):
    """A command of the page with two points an axis."""
    return re.sub(r"(--axis \S+):3\b", r"\1:2", line)


def shorter_brief(text):
    """The template of a brief with eight machines, one tolerance and one change."""
    text = text.replace("series = 32", "series = 8")
    for section, kept in (("tolerances", 'clearance = "5 %"'), ("changes", 'speed = ["25 Hz"]')):
        text = re.sub(rf"(?s)(\[{section}\][^\n]*\n).*?\n\n", rf"\1{kept}\n\n", text)
    return text


@pytest.mark.slow
def test_the_page_runs(tmp_path, monkeypatch, capsys):
    """Its Python, its files and its commands run in the order in which they stand, and leave report and picture.

    The template of a brief is judged in each run of the tests by ``tests/design/test_criteria.py``.
    """
    monkeypatch.chdir(tmp_path)
    names, tested = {}, hammer()
    for kind, text in re.findall(r"```(python|toml|console)\n(.*?)```", PAGE, re.DOTALL):
        if kind == "python":
            exec(compile(text, "own-machine.md", "exec"), names)
        elif kind == "toml":
            marks = {"motor - 3 wheel": "gears", "arcmin": "servo", "[[joint]]": "arm2", "tangent": "blade"}
            name = next((name for mark, name in marks.items() if mark in text), "arm")
            Path(f"{name}.toml").write_text(text)
        else:
            for line in text.strip().splitlines():
                command, _, target = shorter(line).partition(" > ")
                result = CliRunner().invoke(app, shlex.split(command)[1:], catch_exceptions=False)
                assert result.exit_code == 0, f"{line}: {result.output}"
                if target:
                    Path(target).write_text(shorter_brief(result.stdout))
                if "diagnose" in command:
                    assert re.search(r"(arm2?|servo|blade).toml: (periodic|quasi|chaotic|undetermined)", result.stdout)
    assert "Type" in Path("report.html").read_text()
    assert Path("overlay.png").stat().st_size > 10_000
    assert 20.0 < names["arm"].natural_frequencies[0] < 25.0
    assert len(names["observation"]) == 14
    assert (names["record"].peak_force.max(axis=0) > 0.0).sum() >= 3
    np.testing.assert_allclose(names["frequencies"], tested.natural_frequencies, rtol=2e-3)
    for row, point in zip(names["shapes"], ("tip", "motor"), strict=True):
        np.testing.assert_allclose(np.abs(row), np.abs(tested.modes.shape(point)), rtol=2e-2, atol=5e-3)
