"""One column of readings, written in every format by that format's own library."""

import gc
import io
import warnings

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat


def text(mark, comma=False):
    """CSV with a delimiter, a counter beside the readings, and the unit in a row of its own."""

    def write(path, title, unit, values):
        rows = [("n", title), *([("-", unit)] if unit else [])]
        rows += [(k, repr(value).replace(".", "," if comma else ".")) for k, value in enumerate(values.tolist())]
        path.write_text("\n".join(mark.join(map(str, row)) for row in rows))

    return write


def parquet(path, title, unit, values):
    """A table of pyarrow, the unit among the properties of the field."""
    field = pa.field(title, pa.float64(), metadata={"unit": unit} if unit else None)
    pq.write_table(pa.table([values], schema=pa.schema([field])), path)


def records(path, title, unit, values):
    """Records of NumPy, which hold titles and no properties."""
    with open(path, "wb") as file:
        np.save(file, np.array([(value,) for value in values], dtype=[(title, float)]))


def hdf(path, title, unit, values):
    """A data set of h5py in a group, the unit its attribute."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.create_group("rig")[title] = values
        if unit:
            file["rig"][title].attrs["Units"] = unit


def matlab_7_3(path, title, unit, values):
    """The same behind the 512 bytes of MATLAB 7.3."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        file[title] = values[None, :]
        if unit:
            file[title].attrs["unit"] = unit
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124, b" ") + b"\0\2IM")


def matlab(path, title, unit, values):
    """A variable of SciPy's, in a structure with its unit where there is one."""
    savemat(path, {"rig": {title: values, "unit": unit}} if unit else {title: values})


def tdms(path, title, unit, values):
    """A channel of npTDMS, the unit its property."""
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as file:
        told = {"unit_string": unit} if unit else {}
        file.write_segment([nptdms.ChannelObject("rig", title, values, properties=told)])


def mdf(path, title, unit, values):
    """A channel of asammdf."""
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF()
    file.append(asammdf.Signal(values, np.arange(len(values)) / 1000.0, name=title, unit=unit))
    file.save(path.with_suffix(".mf4"), overwrite=True)
    file.close()
    path.with_suffix(".mf4").rename(path)


def excel(path, title, unit, values):
    """A sheet of openpyxl, the unit in a row of its own."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in [[title], *([[unit]] if unit else []), *([value] for value in values.tolist())]:
        book.active.append(row)
    stream = io.BytesIO()
    book.save(stream)
    path.write_bytes(stream.getvalue())


def universal(path, title, unit, values, binary=0, step=0.001):
    """A data set 58 of pyuff."""
    pyuff = pytest.importorskip("pyuff")
    kinds = {"abscissa_spec_data_type": 17, "ordinate_spec_data_type": 13, "orddenom_spec_data_type": 0}
    places = {"func_type": 1, "rsp_node": 1, "rsp_dir": 1, "ref_dir": 1, "ref_node": 0, "ord_data_type": 4}
    shape = {"num_pts": len(values), "abscissa_spacing": 1, "abscissa_inc": step, "abscissa_min": 0.0}
    named = {"id1": title, "ordinate_axis_units_lab": unit or "NONE", "rsp_ent_name": "rig", "ref_ent_name": "rig"}
    one = pyuff.prepare_58(
        binary=binary, **places, **kinds, **shape, **named, data=values, x=np.arange(len(values)) * step
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves its file to the collector
        pyuff.UFF(str(path)).write_sets(one, mode="add")
        gc.collect(0)


def universal_binary(path, title, unit, values):
    """The same with binary numbers."""
    universal(path, title, unit, values, 1)


WRITERS = {
    "CSV": text(","),
    "CSV of half of Europe": text(";", comma=True),
    "tabs": text("\t"),
    "Parquet": parquet,
    "NumPy": records,
    "HDF5": hdf,
    "MATLAB 7.3": matlab_7_3,
    "MATLAB": matlab,
    "TDMS": tdms,
    "MDF": mdf,
    "Excel": excel,
    "UFF": universal,
    "UFF, binary": universal_binary,
}
