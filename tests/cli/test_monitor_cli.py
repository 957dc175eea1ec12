"""``monitor`` on the command line: peaks that arrive one by one."""

import json
import subprocess
import sys

import numpy as np

from tests.classifier.made_up import settled
from tests.cli.run import run


def lines_of(record):
    """Peaks, one a line."""
    return "\n".join(f"{peak:.4f}" for peak in record) + "\n"


def test_monitor_prints_a_line_each_cycle_and_logs_its_events(tmp_path):
    """Regular at first, an alarm soon after chaos begins, and the event in the log."""
    peaks = np.concatenate([settled(3.2, 40), settled(3.9, 20)])
    log = tmp_path / "events.csv"
    code, out, _ = run("monitor", "--sensor-error", "1", "--log", log, "--json", stdin=lines_of(peaks))
    seen = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [one["cycle"] for one in seen] == list(range(1, 61))
    assert [one["alarm"] for one in seen[32:40]] == [False] * 8
    assert seen[-1]["alarm"]
    (alarm,) = [one["cycle"] for one in seen if one["event"] == "alarm"]
    assert 41 <= alarm <= 50
    assert f"{alarm},alarm," in log.read_text()


def test_a_watch_survives_what_is_no_reading():
    """Text, NaN, a negative force and a column that is short are counted and warned of; the watch goes on."""
    lines = [f"{k};{50.0 + 0.1 * (k % 3)}" for k in range(80)]
    lines[40:44] = ["40;nan", "41;abc", "42;-3", "43"]
    code, out, err = run("monitor", "--column", "2", "--json", stdin="\n".join(["cycle;F [N]", *lines]))
    seen = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [one["event"] for one in seen if one["event"]] == ["missing"] * 4
    assert seen[-1]["alarm"] is False
    assert err.count("left out") == 4
    code, _, err = run("monitor", stdin="100 N\n" * 300)
    assert code == 2
    assert "state --column" in err


def test_monitor_answers_before_the_next_peak_comes():
    """The verdict of a cycle is printed while standard input is still open."""
    command = [sys.executable, "-m", "chaosgym", "monitor", "--sensor-error", "1"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        for cycle, peak in enumerate(settled(3.2, 9), start=1):
            process.stdin.write(f"{peak}\n")
            process.stdin.flush()
            assert process.stdout.readline().split()[0] == str(cycle)
        process.stdin.close()


def test_what_is_no_stream_of_forces_ends_in_one_line():
    """Nothing at all, a time limit of nothing, another quantity."""
    for arguments, message in (
        ((), "standard input holds no peak"),
        (("--timeout-s", "0"), "out of range"),
        (("--read", "unit=g"), "the monitor asks for forces"),
        (("--sensor-error", "0.1 g"), "error is in g, the readings are in N"),
    ):
        code, out, err = run("monitor", *arguments)
        assert (code, out) == (2, "")
        assert message in err
        assert len(err.strip().splitlines()) == 1
