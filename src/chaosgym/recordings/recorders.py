"""Columns of recorders' own formats: TDMS, MDF, HDF5 and MATLAB, Excel, WAV and FLAC, by the libraries that read them.

What is not among the dependencies is the extra ``[recordings]``; without it a file says what it is and what to install.
"""

import importlib
import io
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError

OF_RATE = re.compile(r"fs|f_s|rate|sampl\w*?[_ ]?(rate|freq\w*|frequency)|samplerate", re.IGNORECASE)
OF_STEP = re.compile(r"wf_increment|increment|dt|dx|delta[_ ]?[tx]", re.IGNORECASE)
OF_UNIT = re.compile(r"unit_string|units?|quantity", re.IGNORECASE)
"""Names under which files keep the sampling rate [Hz], the interval [s] and the unit of a column."""


def needed(module: str, what: str) -> Any:
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
            f"is {what}, which needs the extra [recordings]: pip install {name}; or export it as CSV"
        ) from error


class Columns:
    """Columns that are found one after the other, with units, and the rate that most of them have."""

    def __init__(self) -> None:
        self.columns: dict[str, Array] = {}
        self.units: dict[str, str] = {}
        self.rates: dict[str, float] = {}
        self.rate: float | None = None

    def add(self, name: str, values: Any, unit: str = "", rate: float | None = None) -> None:
        """Take the numbers of an array (n,) or (n, columns); the longer side are the readings."""
        table = np.asarray(values)
        if table.dtype.kind == "M":
            table, unit = (table - table.flat[0]) / np.timedelta64(1, "s"), "s"
        if table.dtype.kind not in "fiub" or table.size < 2:
            return
        table = np.atleast_2d(np.squeeze(table).astype(float))
        if table.ndim != 2:
            return
        table = table.T if table.shape[0] < table.shape[1] else table
        for place, column in enumerate(table.T, start=1):
            title = name if table.shape[1] == 1 else f"{name} {place}"
            title = next(t for t in (title, *(f"{title} ({k})" for k in range(2, 10**6))) if t not in self.columns)
            self.columns[title] = column
            if unit:
                self.units[title] = unit
            if rate:
                self.rates[title] = rate

    def found(self, form: str) -> dict[str, Any]:
        """Columns of the time base that most readings have; the others are named in ``form``."""
        sizes = [len(values) for values in self.columns.values()]
        size = max(set(sizes), key=lambda n: (n * sizes.count(n), n), default=0)
        kept = {name: values for name, values in self.columns.items() if len(values) == size}
        left = [name for name in self.columns if name not in kept]
        rates = {self.rates[name] for name in kept if name in self.rates}
        rate = rates.pop() if len(rates) == 1 else self.rate
        if left:
            form += f", of another length and left out: {', '.join(left[:5])}"
        return {"columns": kept, "units": self.units, "rate_hz": rate, "form": form}


def tdms(data: bytes) -> dict[str, Any]:
    """Channels of a file of LabVIEW or DIAdem."""
    file = needed("nptdms", "a TDMS file").TdmsFile.read(io.BytesIO(data))
    found = Columns()
    for group in file.groups():
        for channel in group.channels():
            step = float(channel.properties.get("wf_increment", 0.0) or 0.0)
            unit = str(channel.properties.get("unit_string", "") or "").strip()
            found.add(channel.name, channel[:], unit, 1.0 / step if step > 0.0 else None)
    return found.found("TDMS")


def mdf(data: bytes) -> dict[str, Any]:
    """Channels of a measurement file of the automotive industry, version 3 or 4; their common time is ``time``."""
    found, times = Columns(), dict[int, Array]()
    with needed("asammdf", "an MDF file").MDF(io.BytesIO(data)) as file:
        for group in range(len(file.groups)):
            for signal in file.select([(None, group, i) for i in range(len(file.groups[group].channels))]):
                if signal.name.casefold() not in ("time", "t") or not np.array_equal(signal.samples, signal.timestamps):
                    found.add(signal.name, signal.samples, str(signal.unit or "").strip())
                    times[len(signal.timestamps)] = signal.timestamps
    told = found.found("MDF")
    size = len(next(iter(told["columns"].values()), ()))
    if size in times:
        told["columns"] = {"time": np.asarray(times[size], dtype=float), **told["columns"]}
        told["units"]["time"] = "s"
    return told


def hdf(data: bytes) -> dict[str, Any]:
    """Data sets of an HDF5 file, that of MATLAB 7.3 included."""
    what = "a MATLAB file of version 7.3" if data[:6] == b"MATLAB" else "an HDF5 file"
    h5py = needed("h5py", what)
    found = Columns()

    def take(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or name.startswith("#refs#"):
            return
        rate, unit = None, ""
        for key, value in item.attrs.items():
            rate = _rate_of(key, value) or rate
            if OF_UNIT.fullmatch(key):
                unit = value.decode() if isinstance(value, bytes) else str(value)
        if item.size == 1 and item.dtype.kind in "fiu":
            found.rate = _rate_of(name.rsplit("/", 1)[-1], item[()]) or found.rate
        found.add(name, item[()] if item.dtype.kind in "fiu" and item.size > 1 else (), unit, rate)

    with h5py.File(io.BytesIO(data), "r") as file:
        file.visititems(take)
    return found.found("MATLAB 7.3" if data[:6] == b"MATLAB" else "HDF5")


def matlab(data: bytes) -> dict[str, Any]:
    """Variables of a MATLAB file, fields of structures included."""
    if data[:10] == b"MATLAB 7.3":
        return hdf(data)
    from scipy.io import loadmat

    found = Columns()

    def take(name: str, value: Any) -> None:
        if isinstance(value, np.ndarray) and value.dtype.names:
            for number, one in enumerate(value.reshape(-1)[:1000]):
                for key in value.dtype.names:
                    several = f"{name}({number + 1})" if value.size > 1 else name
                    take(f"{several}.{key}", one[key])
        elif isinstance(value, np.ndarray) and value.dtype.kind == "O":
            for number, one in enumerate(value.reshape(-1)[:1000]):
                take(f"{name}({number + 1})" if value.size > 1 else name, one)
        elif isinstance(value, np.ndarray) and value.size == 1:
            found.rate = _rate_of(name.rsplit(".", 1)[-1], value) or found.rate
        elif isinstance(value, np.ndarray):
            found.add(name, value)

    for name, value in loadmat(io.BytesIO(data)).items():
        if not name.startswith("__"):
            take(name, value)
    return found.found("MATLAB")


def _rate_of(key: str, value: Any) -> float | None:
    """Sampling rate [Hz] that a named number tells."""
    try:
        number = float(np.ravel(value)[0])
    except (TypeError, ValueError, IndexError):
        return None
    if not 0.0 < number < 1e12:
        return None
    return number if OF_RATE.fullmatch(key) else 1.0 / number if OF_STEP.fullmatch(key) else None


def excel(data: bytes) -> bytes:
    """The first sheet of a workbook with numbers, as the text of a CSV file."""
    book = needed("openpyxl", "an Excel workbook").load_workbook(io.BytesIO(data), read_only=True, data_only=True)
    for sheet in book.worksheets:
        rows = ["\t".join(_cell(value) for value in row) for row in sheet.iter_rows(values_only=True)]
        if any(re.search(r"\d", row) for row in rows):
            return "\n".join(rows).encode()
    raise DiagnosisError("holds no numbers")


def _cell(value: Any) -> str:
    return "" if value is None else repr(value) if isinstance(value, float) else str(value).replace("\t", " ")


def wav(data: bytes) -> dict[str, Any]:
    """Channels of a WAV file; whole numbers as shares of the full scale."""
    from scipy.io import wavfile

    rate, samples = wavfile.read(io.BytesIO(data))
    return _sound(samples, float(rate), "WAV")


def flac(data: bytes) -> dict[str, Any]:
    """Channels of a FLAC file, as shares of the full scale."""
    samples, rate = needed("soundfile", "a FLAC file").read(io.BytesIO(data), dtype="int32")
    return _sound(samples, float(rate), "FLAC")


def _sound(samples: NDArray[Any], rate: float, form: str) -> dict[str, Any]:
    found, whole = Columns(), samples.dtype.kind in "iu"
    scaled = samples.astype(float)
    if samples.dtype.kind == "u":
        scaled = (scaled - 128.0) / 128.0
    elif whole:
        scaled /= 2.0 ** (8 * samples.dtype.itemsize - 1)
    for place, column in enumerate(np.atleast_2d(scaled.T), start=1):
        found.add(f"column {place}", column, "FS" if whole else "", rate)
    return {**found.found(f"{form}, {rate:g} Hz"), "named": False}


READERS = {
    b"TDSm": (tdms, "TDMS"),
    b"MDF     ": (mdf, "MDF"),
    b"\x89HDF\r\n\x1a\n": (hdf, "HDF5"),
    b"fLaC": (flac, "FLAC"),
}
"""Function that reads a format, and its name, by the first bytes."""
