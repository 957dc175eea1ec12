"""Readers of recorders' formats: one function each, told by a file's first bytes, in the table ``FORMATS``.

A reader returns the columns as the file holds them with what it says of them (``Raw``); it decides no name, unit or
rate. What is not among the dependencies is an extra; without it a file says what it is and what to install.
"""

import importlib
import io
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.raw import Data, Parts, Raw, stream
from chaosgym.recordings.text import read_text


def parquet(data: Data) -> Raw:
    """Columns of a table; properties of a field, such as its unit, are stated."""
    import pyarrow.parquet as pq

    table, raw = pq.read_table(io.BytesIO(data)), Raw("Parquet")
    for field in table.schema:
        stated = {key.decode(errors="replace"): value for key, value in (field.metadata or {}).items()}
        raw.add(field.name, table.column(field.name).to_numpy(), stated)
    return raw


def numpy(data: Data) -> Raw:
    """An array (n,) or (n, columns), or one of records with names."""
    array = np.load(stream(data), allow_pickle=False)
    raw = Raw("NumPy", named=bool(array.dtype.names))
    for name in array.dtype.names or ():
        raw.add(name, array[name])
    if not raw.named:
        if array.ndim > 2:
            raise DiagnosisError(f"holds an array of shape {array.shape}; allowed: (n,) or (n, columns)")
        raw.add("column", np.atleast_1d(array))
    return raw


def universal(data: Data) -> Raw:
    """Data sets 58 of a universal file."""
    pyuff, raw = needed("pyuff", "a universal file", "uff"), Raw("UFF")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.uff"
        path.write_bytes(data)
        sets = pyuff.UFF(str(path)).read_sets()
    for place, one in enumerate([sets] if isinstance(sets, dict) else sets, start=1):
        if one.get("type") == 58 and "data" in one:
            title = str(one.get("id1") or "").strip() or f"channel {place}"
            stated = {"unit": one.get("ordinate_axis_units_lab"), "dx": one.get("abscissa_inc")}
            raw.add(title, np.real(one["data"]), stated)
    return raw


def tdms(data: Data) -> Raw:
    """Channels of a file of LabVIEW or DIAdem."""
    file, raw = needed("nptdms", "a TDMS file").TdmsFile.read(io.BytesIO(data)), Raw("TDMS")
    for group in file.groups():
        for channel in group.channels():
            raw.add(channel.name, channel[:], channel.properties)
    return raw


def mdf(data: Data) -> Raw:
    """Channels of a measurement file of the automotive industry, version 3 or 4; their common time is ``time``."""
    raw, times = Raw("MDF"), dict[int, Any]()
    with needed("asammdf", "an MDF file").MDF(io.BytesIO(data)) as file:
        for group in range(len(file.groups)):
            for signal in file.select([(None, group, i) for i in range(len(file.groups[group].channels))]):
                if signal.name.casefold() not in ("time", "t") or not np.array_equal(signal.samples, signal.timestamps):
                    raw.add(signal.name, signal.samples, {"unit": signal.unit})
                    times[len(signal.timestamps)] = signal.timestamps
    for stamps in times.values():
        raw.add("time", stamps, {"unit": "s"})
    return raw


def hdf(data: Data) -> Raw:
    """Data sets of an HDF5 file, that of MATLAB 7.3 included."""
    form, what = ("MATLAB 7.3", "a MATLAB file of version 7.3") if data[:6] == b"MATLAB" else ("HDF5", "an HDF5 file")
    h5py, raw = needed("h5py", what), Raw(form)

    def take(path: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset):
            raw.stated.update({key: value for key, value in item.attrs.items() if np.size(value) == 1})
        if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiu" or path.startswith("#refs#"):
            return
        if item.size == 1:
            raw.stated[path] = item[()]
            return
        *groups, title = re.split(r"(?<! )/(?! )", path)
        raw.add(title, item[()], dict(item.attrs), "/".join(groups))

    with h5py.File(io.BytesIO(data), "r") as file:
        take("", file)
        file.visititems(take)
    return raw


def matlab(data: Data) -> Raw:
    """Variables of a MATLAB file, fields of structures included; a text beside them in a structure is a property."""
    from scipy.io import loadmat

    raw = Raw("MATLAB")

    def take(name: str, value: Any, beside: dict[str, Any]) -> None:
        if value.dtype.names:
            for number, one in enumerate(value.reshape(-1)[:1000]):
                several = f"{name}({number + 1})" if value.size > 1 else name
                texts = {key: str(one[key].flat[0]) for key in value.dtype.names if _is_text(one[key])}
                for key in value.dtype.names:
                    take(f"{several}.{key}", one[key], texts)
        elif value.dtype.kind == "O":
            for number, one in enumerate(value.reshape(-1)[:1000]):
                take(f"{name}({number + 1})" if value.size > 1 else name, np.asarray(one), beside)
        elif value.dtype.kind in "fiub" and value.size == 1:
            raw.stated[name] = value.flat[0]
        elif value.dtype.kind in "fiub":
            raw.add(name, value, beside)

    for name, value in loadmat(io.BytesIO(data)).items():
        if not name.startswith("__"):
            take(name, np.asarray(value), {})
    return raw


def _is_text(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind == "U" and value.size == 1


def excel(data: Data) -> Parts:
    """Sheets of a workbook."""
    book = needed("openpyxl", "an Excel workbook").load_workbook(io.BytesIO(data), read_only=True, data_only=True)

    def read(sheet: Any) -> Raw:
        rows = ("\t".join(_cell(value) for value in row) for row in sheet.iter_rows(values_only=True))
        return read_text("\n".join(rows).encode())

    return {sheet.title: lambda sheet=sheet: read(sheet) for sheet in book.worksheets}  # type: ignore[misc]


def _cell(value: Any) -> str:
    return "" if value is None else repr(value) if isinstance(value, float) else str(value).replace("\t", " ")


def wav(data: Data) -> Raw:
    """Channels of a WAV file; whole numbers as shares of the full scale."""
    from scipy.io import wavfile

    rate, samples = wavfile.read(io.BytesIO(data))
    return _sound(samples, float(rate), "WAV")


def flac(data: Data) -> Raw:
    """Channels of a FLAC file, as shares of the full scale."""
    samples, rate = needed("soundfile", "a FLAC file").read(io.BytesIO(data), dtype="int32")
    return _sound(samples, float(rate), "FLAC")


def _sound(samples: Any, rate: float, form: str) -> Raw:
    raw, kind, full = Raw(form, named=False), samples.dtype.kind, 2.0 ** (8 * samples.dtype.itemsize - 1)
    scaled = samples / full - (1.0 if kind == "u" else 0.0) if kind in "iu" else samples
    raw.add("column", scaled, {"rate": rate, "unit": "FS" if kind in "iu" else ""})
    return raw


class Format(NamedTuple):
    """A format: its name, its first bytes as a pattern, and the function that reads it."""

    name: str
    first: bytes
    read: Callable[[Data], Raw | Parts]


FORMATS = (
    Format("Parquet", rb"PAR1", parquet),
    Format("NumPy", rb"\x93NUMPY", numpy),
    Format("MATLAB 7.3", rb"MATLAB 7\.3", hdf),
    Format("MATLAB", rb"MATLAB", matlab),
    Format("HDF5", rb"\x89HDF\r\n\x1a\n", hdf),
    Format("TDMS", rb"TDSm", tdms),
    Format("MDF", rb"MDF     ", mdf),
    Format("Excel", rb"PK\x03\x04", excel),
    Format("UFF", rb"[ \t]*-1[ \t\r]*\n", universal),
    Format("WAV", rb"RIF[FX]", wav),
    Format("FLAC", rb"fLaC", flac),
    Format("CSV", rb"", read_text),
)
"""Formats in the order in which they are tried; what is none of the first is text."""


def format_of(data: Data) -> Format:
    """Format of the bytes."""
    return next(each for each in FORMATS if re.match(each.first, data))


def needed(module: str, what: str, extra: str = "recordings") -> Any:
    """The library ``module``.

    Raises
    ------
    DiagnosisError
        If it is not installed; says what the file is and what to install.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        name = {"nptdms": "npTDMS"}.get(module, module)
        raise DiagnosisError(
            f"is {what}, which needs the extra [{extra}]: pip install {name}; or export it as CSV"
        ) from error
