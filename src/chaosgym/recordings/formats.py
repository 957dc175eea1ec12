"""Readers of recorders' formats: one function each, told by a file's first bytes, in the table ``FORMATS``.

A reader returns the columns as the file holds them with what it says of them (``Raw``); it decides no name, unit or
rate. Where the file can claim more than it holds, its head is counted before it is read. What is not among the
dependencies is an extra; without it a file says what it is and what to install.
"""

import importlib
import re
import tempfile
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.raw import LONGEST, Data, Parts, Raw, TooMuch, check_readings, cut, give_back, stream
from chaosgym.recordings.text import read_text

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

MOST_UNIVERSAL = 100_000_000
"""Bytes of a universal file, for which its library needs eight times as many."""

RECORDS = 2**20
"""Records of an MDF file, and rows of a table, that are read at a time."""

FIRST_ROWS = 1000
"""Rows of a column of text in a table, of which the first is shown."""


def parquet(data: Data) -> Raw:
    """Columns of a table; properties of a field, such as its unit, are stated."""
    import pyarrow as pa

    from chaosgym.parquet import cells_of, opened

    raw = Raw("Parquet")
    with opened(pa.BufferReader(data)) as file:
        check_readings(cells_of(file))
        fields = [field for field in file.schema_arrow if not pa.types.is_nested(field.type)]
        numbers = [field.name for field in fields if pa.types.is_primitive(field.type)]
        texts = [field.name for field in fields if field.name not in numbers]
        batches = file.iter_batches(FIRST_ROWS, columns=texts) if texts else iter(())
        first = next(batches, None)
        for field in fields:
            stated = {key.decode(errors="replace"): value for key, value in (field.metadata or {}).items()}
            if field.name in numbers:
                raw.add(field.name, _numbers(file, field), stated)
                give_back(data)
            elif first is not None:
                raw.add(field.name, np.array(_cells(first.column(field.name)), dtype=object), stated)
    return raw


def _numbers(file: "pq.ParquetFile", field: "pa.Field") -> Any:
    """A column of numbers; real ones batch by batch, so that they are in memory once."""
    import pyarrow as pa

    if not pa.types.is_floating(field.type):
        return file.read([field.name]).column(0).to_numpy()
    values, place = np.empty(file.metadata.num_rows, field.type.to_pandas_dtype()), 0
    for batch in file.iter_batches(RECORDS, columns=[field.name]):
        values[place : place + len(batch)] = batch.column(0).to_numpy(zero_copy_only=False)
        place += len(batch)
    return values


def _cells(column: "pa.Array") -> list[Any]:
    """Values of a column of a table that are no numbers; of long texts the beginning, cut before they are repeated."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if pa.types.is_dictionary(column.type):
        entries = _cells(column.dictionary)
        return [None if place is None else entries[place] for place in column.indices.to_pylist()]
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        column = pc.utf8_slice_codeunits(column, 0, LONGEST)
    values: list[Any] = column.to_pylist()
    return values


def numpy(data: Data) -> Raw:
    """An array (n,) or (n, columns), or one of records with names."""
    array = np.load(stream(data), allow_pickle=False)  # holds no more than the file
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
    if len(data) > MOST_UNIVERSAL:
        raise TooMuch(f"holds {len(data):,} bytes; allowed of a universal file: {MOST_UNIVERSAL:,}; export it as CSV")
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
    raw = Raw("TDMS")
    with needed("nptdms", "a TDMS file").TdmsFile.open(stream(data)) as file:
        channels = [channel for group in file.groups() for channel in group.channels()]
        check_readings(sum(map(len, channels)))
        for channel in channels:
            raw.add(channel.name, channel[:], channel.properties)
    return raw


def mdf(data: Data) -> Raw:
    """Channels of a measurement file of the automotive industry, version 3 or 4; their common time is ``time``."""
    raw, times = Raw("MDF"), dict[int, Any]()
    with needed("asammdf", "an MDF file").MDF(stream(data)) as file:
        heads = [(group.channel_group, len(group.channels)) for group in file.groups]
        check_readings(sum(head.cycles_nr * max(count, head.samples_byte_nr // 8) for head, count in heads))
        for group, (head, count) in enumerate(heads):
            stamps = _records(head.cycles_nr, partial(file.get_master, group))
            for channel in range(count):
                samples, name, unit = _channel(file, group, channel, head.cycles_nr)
                if name.casefold() not in ("time", "t") or not np.array_equal(samples, stamps):
                    raw.add(name, samples, {"unit": unit})
                    times[len(stamps)] = stamps
    for stamps in times.values():
        raw.add("time", stamps, {"unit": "s"})
    return raw


def _records(count: int, read: Callable[..., Any]) -> Any:
    """So many records of an MDF file, a million at a time, as the library makes several copies of them."""
    first = read(record_offset=0, record_count=RECORDS)
    if count <= RECORDS:
        return first
    whole = np.empty((count, *first.shape[1:]), first.dtype)
    for start in range(0, count, RECORDS):
        whole[start : start + RECORDS] = read(record_offset=start, record_count=RECORDS)
    return whole


def _channel(file: Any, group: int, channel: int, count: int) -> tuple[Any, str, str]:
    """(samples, name, unit) of a channel of an MDF file."""
    told = file.get(group=group, index=channel, record_count=1)

    def samples(**of: int) -> Any:
        return file.get(group=group, index=channel, **of).samples

    return _records(count, samples), told.name, told.unit


def hdf(data: Data) -> Raw:
    """Data sets of an HDF5 file, that of MATLAB 7.3 included."""
    form, what = ("MATLAB 7.3", "a MATLAB file of version 7.3") if data[:6] == b"MATLAB" else ("HDF5", "an HDF5 file")
    h5py, raw, size, sets = needed("h5py", what), Raw(form), 0, list[tuple[str, Any]]()

    def take(path: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset):
            raw.stated.update({key: value for key, value in item.attrs.items() if np.size(value) == 1})
        if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiu" or path.startswith("#refs#"):
            return
        if item.size == 1:
            raw.stated[path] = item[()]
            return
        if item.is_virtual or item.external:
            raise DiagnosisError(
                f"holds a data set, {cut(path)!r}, whose readings are in another file; copy them into it"
            )
        nonlocal size
        size += item.size
        check_readings(size)
        sets.append((path, item))

    with h5py.File(stream(data), "r") as file:
        take("", file)
        file.visititems(take)
        for path, item in sets:
            *groups, title = re.split(r"(?<! )/(?! )", path)
            raw.add(title, item[()], dict(item.attrs), "/".join(groups))
    return raw


def matlab(data: Data) -> Raw:
    """Variables of a MATLAB file of version 5."""
    from chaosgym.recordings.matlab import matlab as read

    return read(data)


MOST_CELLS, TAGS_OF_A_CELL = 5_000_000, 3
"""Cells of a workbook that are read, a minute's work, and tags that end in each."""

MOST_UNPACKED = 2**28
"""Bytes to which a workbook may unpack."""


def excel(data: Data) -> Parts:
    """Sheets of a workbook."""
    openpyxl = needed("openpyxl", "an Excel workbook")
    _check_workbook(data)
    book, cells = openpyxl.load_workbook(stream(data), read_only=True, data_only=True), 0

    def read(sheet: Any) -> Raw:
        nonlocal cells
        rows: list[str] = []
        for row in sheet.iter_rows(values_only=True):
            cells += len(row)
            if cells > MOST_CELLS:
                raise TooMuch(f"has more than {MOST_CELLS:,} cells, which are read; export it as CSV")
            rows.append("\t".join(map(_cell, row)).rstrip("\t"))
        return read_text("\n".join(rows).encode())

    return {sheet.title: lambda sheet=sheet: read(sheet) for sheet in book.worksheets}  # type: ignore[misc]


def _check_workbook(data: Data) -> None:
    """Refuse a workbook that unpacks to too much, or holds too many cells by the tags that end in its sheets."""
    with zipfile.ZipFile(stream(data)) as archive:
        if (size := sum(member.file_size for member in archive.infolist())) > MOST_UNPACKED:
            raise TooMuch(f"unpacks to {size:,} bytes; allowed: up to {MOST_UNPACKED:,}; export it as CSV")
        tags = 0
        for member in archive.infolist():
            with archive.open(member) as text:
                while part := text.read(2**20):
                    tags += part.count(b"</") + part.count(b"/>")
    if tags > TAGS_OF_A_CELL * MOST_CELLS:
        raise TooMuch(f"has more than {MOST_CELLS:,} cells, which are read; export it as CSV")


def _cell(value: Any) -> str:
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)[:LONGEST].replace("\t", " ")


def wav(data: Data) -> Raw:
    """Channels of a WAV file; whole numbers as shares of the full scale."""
    from scipy.io import wavfile

    rate, samples = wavfile.read(stream(data))
    return _sound(samples, float(rate), "WAV")


def flac(data: Data) -> Raw:
    """Channels of a FLAC file, as shares of the full scale."""
    with needed("soundfile", "a FLAC file").SoundFile(stream(data)) as file:
        check_readings(file.frames * file.channels)
        return _sound(file.read(dtype="int32"), float(file.samplerate), "FLAC")


def _sound(samples: Any, rate: float, form: str) -> Raw:
    check_readings(samples.size)
    raw, kind, full = Raw(form, named=False), samples.dtype.kind, 2.0 ** (8 * samples.dtype.itemsize - 1)
    scaled = samples / full - (1.0 if kind == "u" else 0.0) if kind in "iu" else samples
    raw.add("column", scaled, {"rate": rate, "unit": "FS" if kind in "iu" else ""})
    return raw


def archive(data: Data) -> Raw:
    """Arrays of a NumPy archive."""
    from chaosgym.recordings.structured import archive as read

    return read(data)


def json_document(data: Data) -> Raw:
    """Columns of a JSON document, or of one JSON object a line."""
    from chaosgym.recordings.structured import json_document as read

    return read(data)


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
    Format("NumPy archive", rb"(?s)PK\x03\x04.{26}[^\x00]{1,200}?\.npy", archive),
    Format("Excel", rb"PK\x03\x04", excel),
    Format("UFF", rb"[ \t]*-1[ \t\r]*\n", universal),
    Format("WAV", rb"RIF[FX]", wav),
    Format("FLAC", rb"fLaC", flac),
    Format("JSON", rb"(\xef\xbb\xbf)?\s{0,99}(\{\s{0,99}\"|\[\s{0,99}[\[{\d-])", json_document),
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
