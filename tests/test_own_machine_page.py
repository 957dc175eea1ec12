"""The page on one's own machine works as it stands, from the matrices to the report and the agent."""

import re
import shlex
from pathlib import Path

from click.testing import CliRunner

from chaosgym.cli import app

PAGE = (Path(__file__).parent.parent / "docs" / "own-machine.md").read_text()


def test_the_page_runs(tmp_path, monkeypatch, capsys):
    """Its Python, its file and its commands run in the order in which they stand, and leave report and picture."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for kind, text in re.findall(r"```(python|toml|console)\n(.*?)```", PAGE, re.DOTALL):
        if kind == "python":
            exec(compile(text, "own-machine.md", "exec"), names)
        elif kind == "toml":
            Path("arm.toml").write_text(text)
        else:
            for line in text.strip().splitlines():
                command, _, target = line.partition(" > ")
                result = CliRunner().invoke(app, shlex.split(command)[1:], catch_exceptions=False)
                assert result.exit_code == 0, f"{line}: {result.output}"
                if target:
                    Path(target).write_text(result.stdout)
                if "diagnose" in command:
                    assert re.search(r"arm.toml: (periodic|quasiperiodic|chaotic)", result.stdout)
    assert "Type" in Path("report.html").read_text()
    assert Path("overlay.png").stat().st_size > 10_000
    assert 20.0 < names["arm"].natural_frequencies[0] < 25.0
    assert len(names["observation"]) == 14
