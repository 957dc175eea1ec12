"""Names and units are decided in one place, so that a column means the same in every format."""

import io
import sys

import numpy as np
import pytest
from scipy.io import wavfile

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.columns import choose_force
from chaosgym.recordings.quantities import as_unit, split_unit
from chaosgym.recordings.read import read_recording
from chaosgym.recordings.runs import ask_for_force
from tests.recordings.writers import WRITERS

READINGS = np.round(40.0 + 3.0 * np.sin(0.7 * np.arange(40) ** 1.5), 6)

SPELLINGS = ("force [{}]", "force_{}", "force ({})", "Force / {}", "force in {}", "beside")

NEWTONS = {"N": 1.0, "kN": 1000.0, "mN": 0.001, "daN": 10.0, "lbf": 4.4482216152605, "kgf": 9.80665}
"""Newtons in a unit, by the definitions of NIST SP 811, appendix B."""

WRITTEN = {"N": ("Newtons", "newton"), "kN": ("KN", "kilonewtons"), "lbf": ("lbs", "pounds", "LBF")}
"""Other spellings of units in files."""


def written(spelling, unit):
    """(title, unit beside it)."""
    return ("force", unit) if spelling == "beside" else (spelling.format(unit), "")


def possible(form, spelling):
    """Whether a format can hold a spelling: MATLAB's names are letters, digits and underscores."""
    if form == "NumPy":
        return spelling != "beside"
    return form != "MATLAB" or spelling in ("force_{}", "beside")


CASES = [(form, spelling) for form in WRITERS for spelling in SPELLINGS if possible(form, spelling)]


@pytest.mark.parametrize(("form", "spelling"), CASES)
def test_a_unit_means_the_same_newtons_in_every_format(form, spelling, tmp_path):
    """Brackets, an underscore, a row of units, an attribute or a property: each is the same force."""
    for unit, size in NEWTONS.items():
        path = tmp_path / unit
        WRITERS[form](path, *written(spelling, unit), READINGS)
        signal = choose_force(read_recording(path), "force")
        assert signal.unit == "N"
        np.testing.assert_allclose(signal.values, size * READINGS, rtol=1e-6 if form == "UFF" else 1e-12)


@pytest.mark.parametrize("form", WRITERS)
def test_units_written_out_mean_the_same_in_every_format(form, tmp_path):
    """Full names, plurals and capitals, in brackets or beside; MATLAB and NumPy hold one of the two."""
    for unit, spellings in WRITTEN.items():
        for word in spellings:
            path = tmp_path / word
            title, beside = ("force [{}]", "") if form == "NumPy" else ("force", word)
            WRITERS[form](path, title.format(word), beside, READINGS)
            signal = choose_force(read_recording(path), "force")
            np.testing.assert_allclose(signal.values, NEWTONS[unit] * READINGS, rtol=1e-6 if form == "UFF" else 1e-12)


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_a_stream_is_read_as_a_file_is(spelling, monkeypatch, tmp_path):
    """Standard input has the bytes of a file, and its newtons."""
    path = tmp_path / "force.csv"
    WRITERS["CSV"](path, *written(spelling, "kN"), READINGS)
    monkeypatch.setattr(sys, "stdin", io.StringIO(path.read_text()))
    np.testing.assert_allclose(choose_force(read_recording("-"), "force").values, 1000.0 * READINGS, rtol=1e-12)


@pytest.mark.parametrize("kind", ["wav", "flac"])
def test_a_stated_unit_counts_for_sound_files_too(kind, tmp_path):
    """Sound files name neither columns nor units; ``unit`` states the one, ``scale`` makes forces of full scale."""
    path = tmp_path / f"force.{kind}"
    if kind == "wav":
        wavfile.write(path, 1000, READINGS)
        np.testing.assert_allclose(choose_force(read_recording(path), unit="kN").values, 1000.0 * READINGS)
        return
    soundfile = pytest.importorskip("soundfile")
    soundfile.write(path, READINGS / 64.0, 1000, subtype="PCM_24", format="FLAC")
    np.testing.assert_allclose(choose_force(read_recording(path), scale="64 kN/FS").values, 1000.0 * READINGS, atol=0.1)


@pytest.mark.parametrize("form", ["CSV", "Parquet", "HDF5", "TDMS", "MDF", "Excel", "UFF"])
def test_two_units_that_differ_are_a_question(form, tmp_path):
    """A title in N and a property in kN: nothing is assumed, and ``unit`` decides."""
    path = tmp_path / "force"
    WRITERS[form](path, "force [N]", "kN", READINGS)
    recording = read_recording(path)
    with pytest.raises(DiagnosisError, match=r"force' is in N by its title 'force \[N\]' and in kN by .*--read unit"):
        choose_force(recording, "force")
    np.testing.assert_allclose(choose_force(recording, "force", "kN").values, 1000.0 * READINGS, rtol=1e-6)


def test_volts_are_volts_in_every_format(tmp_path):
    """``Volts`` of a property is V, so that a calibration in mV fits."""
    WRITERS["TDMS"](tmp_path / "a", "Load cell", "Volts", READINGS)
    recording = read_recording(tmp_path / "a")
    assert choose_force(recording).unit == "V"
    np.testing.assert_allclose(choose_force(recording, scale="100 mV/N").values, 10.0 * READINGS)


@pytest.mark.parametrize(
    ("word", "unit"),
    [("Volts", "V"), ("grams", "gram"), ("kilograms", "kg"), ("mV", "mV"), ("g", "g"), ("sec", "s"), ("(ms)", "ms")],
)
def test_words_are_units(word, unit):
    """A mass stays a mass: grams are no g, and no newtons."""
    assert as_unit(word) == unit


@pytest.mark.parametrize("title", ["force_min", "Channel A", "Sensor_A", "Input V", "s", "run in", "side_A", "x_in"])
def test_a_unit_is_never_a_word_of_a_title(title):
    """The least force is in no minutes, channel A in no amperes."""
    assert split_unit(title) == (title, "")


@pytest.mark.parametrize("title", ["acc [m/s^2]", "acc_g", "accX", "Beschleunigung", "vib_mm_s", "pressure", "a [bar]"])
def test_what_is_no_force_by_its_title_is_never_taken_for_one(title, tmp_path):
    """No statement of a unit, or of a sensor of forces, makes newtons of an acceleration: no life is told of it."""
    (path := tmp_path / "a").write_text(f"{title}\n1\n3\n2\n")
    recording = read_recording(path)
    assert choose_force(recording).unit != "N"
    with pytest.raises(DiagnosisError, match=r"N is (one|a unit) of force; (leave unit=N out|state its own, such as)"):
        choose_force(recording, unit="N")
    with pytest.raises(DiagnosisError, match="scale = '50 N/FS'"):
        choose_force(recording, scale="50 N/FS")
    with pytest.raises(DiagnosisError, match=r"scale = '100 mV/N'|leave unit=V out"):
        choose_force(recording, unit="V", scale="100 mV/N")
    with pytest.raises(
        DiagnosisError, match="this asks for a force; name a column of one by --read column=NAME, or judge it"
    ):
        ask_for_force("a", choose_force(recording))


@pytest.mark.parametrize(
    ("title", "unit"),
    [("force at the accelerometer", "N"), ("accumulated", "N"), ("F / kN", "lbf"), ("weight [kg]", "kgf"), ("x", "mm")],
)
def test_a_unit_may_be_stated_of_the_dimension_of_the_title(title, unit, tmp_path):
    """A word of force counts before others, and what shows kilograms may be a scale of forces."""
    (path := tmp_path / "a").write_text(f"{title}\n1\n3\n2\n")
    assert choose_force(read_recording(path), "1", unit).values.max() > 1.0


def test_a_title_of_acceleration_beside_a_unit_of_force_is_a_question(tmp_path):
    """Either may be wrong: the unit of an acceleration settles it."""
    (path := tmp_path / "a").write_text("accel [N]\n1\n3\n2\n")
    with pytest.raises(DiagnosisError, match="of acceleration by its title, and N is a unit of force"):
        choose_force(read_recording(path))
    assert choose_force(read_recording(path), unit="g").unit == "g"


def test_the_force_is_found_beside_an_acceleration(tmp_path):
    """A column that may be a force goes before one that is none."""
    (path := tmp_path / "a").write_text("accel,upper\n1,2\n3,1\n2,2\n")
    assert choose_force(read_recording(path)).name == "upper"


def test_columns_may_be_asked_for_by_their_title(tmp_path):
    """``force [kN]`` as the file has it, and ``force``, as the answer has it."""
    WRITERS["Parquet"](tmp_path / "a", "force [kN]", "", READINGS)
    recording = read_recording(tmp_path / "a")
    assert choose_force(recording, "force [kN]").name == choose_force(recording, "force").name == "force"
