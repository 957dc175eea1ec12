"""What ``--json`` prints keeps to docs/answers.schema.json: every command, in each of its forms."""

import json
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner

from chaosgym import demo
from chaosgym.cli import app
from tests.cli.test_conventions import every_command
from tests.small_demo import SMALL

DOCS = Path(__file__).parents[2] / "docs"
SCHEMA = json.loads((DOCS / "answers.schema.json").read_text("utf-8"))

BEAM = "chaosgym/ImpactBeamTolerance-v1"
PEAKS = f'{DOCS}/data/peaks.csv --column upper --sensor-error "1 N"'
CRANK = f"{DOCS}/machines/compressor.toml"
MAP = "sweep impact-beam --axis excitation_frequency=4:26:2 --axis clearance=0.12mm:0.13mm:2 --budget 100 --workers 1"
BRIEF = """machine = "impact-beam"
series = 8
[parameters]
excitation_frequency = "8 Hz"
[tolerances]
clearance = "5 %"
[criteria]
load_rating = "300 N"
life = "2000 Mcycles"
reliability = 0.999
[changes]
clearance = ["0.0635 mm"]
excitation_frequency = ["7 Hz"]
[archard]
limit = "0.2 mm"
sliding = "2 mm"
area = "20 mm^2"
hardness = "2 GPa"
coefficient = 1e-5
uncertainty = 3
[bending]
at = "150 mm"
amplitude = "250 MPa"
cycles = "1 Mcycles"
slope = 5
ultimate = "600 MPa"
mean_stress = "goodman"
notch_factor = 1.5
static_stress = "0 MPa"
uncertainty = 3
"""
QUICK = {
    "simulate": "impact-beam --cycles 3 --out p.csv --series-out s.csv --plot m.png; slider-crank --cycles 2",
    "show": f"impact-beam; {CRANK} --plot c.png",
    "new-machine": "; four-bar --out four-bar.toml",
    "export": "impact-beam --fmu b.fmu",
    "diagnose": "impact-beam --frequency-hz 19 --types --margins --kicks 2; impact-beam;"
    "impact-beam --test two-step --budget 400; slider-crank --test mut",
    "judge": f"{PEAKS}; {DOCS}/data/peaks.csv --column 'upper,lower'; {PEAKS} --load-rating '500 N'",
    "judge-sweep": f'{DOCS}/data/sweep.csv --sensor-error "3 N"',
    "monitor": "",
    "overlay": f"impact-beam {PEAKS} --out o.png",
    "classify": "impact-beam --frequency-hz 19; impact-beam --budget-us 0;"
    f"impact-beam {DOCS}/data/peaks.csv --read column=upper --sensor-error '1 N'",
    "sweep": MAP.removeprefix("sweep ") + " --out map --plot map.png",
    "dataset-info": "map",
    "dataset-map": "map --out map2.png",
    "design": "--template impact-beam",
    "tradeoff": "impact-beam --frequency-hz 19 --step-check",
    "run-agent": f"{BEAM} --machine 13 --load-rating 500; {BEAM} --machine 13; {BEAM} --plant docs.examples.rig:Rig"
    "; chaosgym/AnyMachine-v0",
    "info": "",
}
"""Arguments of each command; several forms are divided by a semicolon, and run in this order in one folder."""

LONG = {
    "fit": f"impact-beam --frequency-hz 30 {PEAKS} --estimate clearance",
    "branch": 'impact-beam --fidelity standard --along "speed=17.3:17.7 Hz:3" --workers 1 --out o.csv;'
    'impact-beam --fidelity standard --along "speed=17.3:17.7 Hz:3" --against "clearance=0.12mm:0.134mm:3" --workers 1',
    "tradeoff": "impact-beam --points 1 --cycles 20 --transient 20 --budget 0.05 --workers 1",
    "compare": f'{BEAM} --machines 2 --only "follow the demand" --out scores.parquet',
    "design": "brief.toml --workers 1 --plot b.png; brief.toml other.toml --workers 1;"
    f"other.toml --workers 1 --beside {DOCS}/data/peaks.csv --read column=upper --read 'sensor-error=1 N'",
    "demo": "--out demo",
    "train-classifier": "--data demo/sweep --out learned",
}

APART = {"explore", "run-up"}
"""Commands with a test of their own."""


def strict(schema):
    """The same schema, by which a key that it does not name is an error."""
    if isinstance(schema, list):
        return [strict(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    inner = {key: strict(part) for key, part in schema.items()}
    closed = isinstance(inner.get("type"), str | list) and isinstance(inner.get("properties"), dict)
    return ({"additionalProperties": False} if closed else {}) | inner


STRICT = strict(SCHEMA)


def check(name, line):
    """A line of standard output is an object as published."""
    schema = {"$ref": f"#/$defs/{name}", "$defs": STRICT["$defs"]}
    jsonschema.Draft202012Validator(schema).validate(json.loads(line))


def check_forms(name, forms, given=None):
    """Every form of a command ends well and prints such objects, one a line, and nothing else."""
    for form in forms.split(";"):
        words = [*name.split("-", 1)] if name.startswith("dataset-") else [name]
        done = CliRunner().invoke(app, [*words, *shlex.split(form), "--json"], input=given)
        assert done.exception is None, (form, done.output, done.exception)
        for line in done.stdout.splitlines():
            check(name, line)
        assert done.stdout


def test_the_schema_is_one_and_names_every_command():
    """A command without a schema, or without a call in these tests, is found."""
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    names = {name.replace(" ", "-") for name, _ in every_command(app)}
    assert names <= set(SCHEMA["$defs"])
    assert names == {*QUICK, *LONG, *APART}


def test_an_unknown_key_and_a_wrong_value_are_found():
    """The check notices what it is there for."""
    told = json.dumps({"wrote": "map.png"})
    check("dataset-map", told)
    for wrong in ('{"wrote": 1}', "{}", '{"wrote": "map.png", "more": 1}'):
        with pytest.raises(jsonschema.ValidationError):
            check("dataset-map", wrong)


def test_quick_answers(tmp_path, monkeypatch):
    """Machines, recordings, streams and folders: what is printed is what is published."""
    monkeypatch.chdir(tmp_path)
    peaks = (DOCS / "data" / "peaks.csv").read_text().splitlines()[1:40]
    stream = "".join(line.split(",")[1] + "\n" for line in peaks)
    for name, forms in QUICK.items():
        check_forms(name, forms, given=stream)


def test_an_answer_of_explore():
    """The address of the page."""
    pytest.importorskip("bokeh")
    command = [sys.executable, "-m", "chaosgym", "explore", "--port", "0", "--no-browser", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        check("explore", server.stdout.readline())
        server.send_signal(signal.SIGINT)
    assert server.returncode == 130


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:CUDA initialization")
def test_long_answers(tmp_path, monkeypatch):
    """The same of what takes longer; the demo with a smaller sweep and fewer machines."""
    monkeypatch.chdir(tmp_path)
    for name, value in SMALL.items():
        monkeypatch.setattr(demo, name, value)
    (tmp_path / "brief.toml").write_text(BRIEF)
    (tmp_path / "other.toml").write_text(BRIEF.partition("[archard]")[0])
    for name, forms in LONG.items():
        check_forms(name, forms)
