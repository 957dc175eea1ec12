"""The page on one's own mechanism works as it stands, from the template to the report and the agent."""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from chaosgym.cli import app

PAGE = (Path(__file__).parent.parent / "docs" / "own-mechanism.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_page_runs(tmp_path, monkeypatch):
    """Its Python and its commands run in the order in which they stand, and leave picture and report."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for before, kind, text in re.findall(r"(.*?)```(python|toml|console)\n(.*?)```", PAGE, re.DOTALL):
        if kind == "python":
            exec(compile(text, "own-mechanism.md", "exec"), names)
            continue
        if kind == "toml":
            named = re.search(r"\(`(\w+\.toml)`\):\s*$", before)
            Path(named[1] if named else "press.toml").write_text(text, encoding="utf-8")
            continue
        for line in text.strip().splitlines():
            command, _, target = line.partition(" > ")
            result = CliRunner().invoke(app, shlex.split(command)[1:], catch_exceptions=False)
            assert result.exit_code == 0, f"{line}: {result.output}"
            if target:
                Path(target).write_text(result.stdout, encoding="utf-8")
    assert "Type" in Path("report.html").read_text(encoding="utf-8")
    assert Path("crank.png").stat().st_size > 10_000
    assert names["crank"].degrees_of_freedom == ("guide across", "guide turn")
    assert len(names["observation"]) == 15
    assert 150.0 < names["info"]["speed"] < names["info"]["set_point"] + 5.0
    assert 0.1 < abs(names["drive"].torque).max() < 100.0
