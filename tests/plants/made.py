"""FMUs under test: one of C, built by gcc, and the examples of pythonfmu and pythonfmu3, which are others' work."""

import shutil
import subprocess
import sys
import zipfile
from importlib import resources
from pathlib import Path

import fmpy
import pytest

VARIABLES = (
    ("speed", "input", 'unit="Hz" start="0"'),
    ("force", "output", 'unit="N"'),
    ("upper", "output", 'unit="N"'),
    ("lower", "output", 'unit="N"'),
    ("ran", "output", 'unit="Hz"'),
    ("top", "parameter", 'unit="Hz" start="1e9"'),
)
VARIABILITY = {"parameter": "fixed", "input": "continuous", "output": "continuous"}


def description(**changes):
    """Description of the rig; ``changes`` replace a text by another."""
    rows = "".join(
        f'<ScalarVariable name="{name}" valueReference="{number}" causality="{causality}" '
        f'variability="{VARIABILITY[causality]}"><Real {about}/></ScalarVariable>'
        for number, (name, causality, about) in enumerate(VARIABLES)
    )
    outputs = "".join(f'<Unknown index="{number}"/>' for number in (2, 3, 4, 5))
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="2.0" modelName="Rig" guid="{rig}" generationTool="gcc">'
        '<CoSimulation modelIdentifier="Rig" canHandleVariableCommunicationStepSize="true"/>'
        '<UnitDefinitions><Unit name="Hz"/><Unit name="N"/></UnitDefinitions>'
        f"<ModelVariables>{rows}"
        '<ScalarVariable name="trouble" valueReference="0" causality="parameter" variability="fixed">'
        '<Integer start="0"/></ScalarVariable></ModelVariables>'
        f"<ModelStructure><Outputs>{outputs}</Outputs><InitialUnknowns>{outputs}</InitialUnknowns></ModelStructure>"
        "</fmiModelDescription>"
    )
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


def rig_fmu(folder):
    """The rig of C as an FMU; skips the test where there is no gcc."""
    if shutil.which("gcc") is None:
        pytest.skip("no gcc")
    binary = folder / f"Rig{fmpy.sharedLibraryExtension}"
    source = Path(__file__).with_name("rig.c")
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", "-o", binary, source, "-lm"], check=True)
    return zipped(folder / "rig.fmu", description(), {f"binaries/{fmpy.platform}/{binary.name}": binary.read_bytes()})


def zipped(path, text, members=()):
    """An FMU of a description and other members."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)
        for name, content in dict(members).items():
            archive.writestr(name, content)
    return path


def example_fmu(library, name, folder):
    """An example of pythonfmu or pythonfmu3, as their wheels have it among their tests."""
    source = resources.files(library) / "tests" / "slaves" / name
    if not source.is_file():
        pytest.skip(f"{library} has no {name}")
    path = folder / f"{library}.fmu"
    built = [sys.executable, "-m", library, "build", "-f", str(source), "-d", str(folder)]
    subprocess.run(built, check=True, capture_output=True)
    made = next(iter(folder.glob("*.fmu")))
    return made.rename(path)
