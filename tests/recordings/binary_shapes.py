"""Replicas of recorders' files that are no text, by each format's own library: writers for ``more_shapes``."""

import gc
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.recordings.recorder_shapes import FORCE, RATE, SIZE, TIME, at


def binaries() -> dict[str, Callable[[Path], None]]:
    """Writers of the formats that are no text, by each format's own library."""
    import asammdf
    import h5py
    import nptdms
    import openpyxl
    import pyarrow as pa
    import pyarrow.parquet as pq
    import pyuff
    import soundfile
    from scipy.io import savemat, wavfile

    share, half = FORCE / 64.0, np.column_stack([FORCE, FORCE]) / 64.0

    def mat(**variables: object) -> Callable[[Path], None]:
        return lambda path: savemat(path, variables, appendmat=False)

    def wav(samples: np.ndarray) -> Callable[[Path], None]:
        return lambda path: wavfile.write(path, int(RATE), samples)

    def sound(form: str) -> Callable[[Path], None]:
        return lambda path: soundfile.write(str(path), share, int(RATE), format=form, subtype="PCM_24")

    def hdf(path: Path, block: int = 0, **sets: object) -> None:
        with h5py.File(path, "w", userblock_size=block) as file:
            for name, values in sets.items():
                file[name] = values

    def hdf_group(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file["Run1/force"] = FORCE
            file["Run1/force"].attrs.update(sample_rate=RATE, unit="N")

    def matlab_7_3(path: Path) -> None:
        hdf(path, 512, force=FORCE[None, :], fs=[[RATE]])
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")

    def mdf(version: str) -> Callable[[Path], None]:
        def write(path: Path) -> None:
            file = asammdf.MDF(version=version)
            file.append(asammdf.Signal(FORCE, TIME, name="Force", unit="N"))
            saved = file.save(str(path) + (".mf4" if version > "4" else ".mdf"), overwrite=True)
            file.close()
            Path(saved).rename(path)

        return write

    def mdf_text(units: bool) -> Callable[[Path], None]:
        def write(path: Path) -> None:
            file = asammdf.MDF()
            file.append(asammdf.Signal(FORCE, TIME, name="Force", unit="N"))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what asammdf asks of pandas is deprecated there
                file.export("csv", str(path) + "_.csv", overwrite=True, add_units=units)
            file.close()
            next(path.parent.glob(path.name + "_*")).rename(path)

        return write

    def tdms(path: Path) -> None:
        stated = {"wf_increment": 1.0 / RATE, "unit_string": "N", "NI_UnitDescription": "Newtons"}
        with nptdms.TdmsWriter(str(path)) as file:
            file.write_segment([nptdms.ChannelObject("Log", "Force", FORCE, properties=stated)])

    def excel(path: Path) -> None:
        book = openpyxl.Workbook()
        book.active.append(["Test 7"])
        sheet = book.create_sheet("Data")
        for row in [("Time [s]", "Force [N]"), *zip(TIME.tolist(), FORCE.tolist(), strict=True)]:
            sheet.append(row)
        book.save(path)

    def parquet(**columns: object) -> Callable[[Path], None]:
        return lambda path: pq.write_table(pa.table(columns), path)

    def universal(binary: int) -> Callable[[Path], None]:
        kinds = {"abscissa_spec_data_type": 17, "ordinate_spec_data_type": 13, "orddenom_spec_data_type": 0}
        places = {"rsp_node": 1, "rsp_dir": 3, "ref_dir": 3, "ref_node": 1}
        entities = {"rsp_ent_name": "rig", "ref_ent_name": "rig"}
        spaced = {"abscissa_spacing": 1, "abscissa_inc": 1.0 / RATE, "abscissa_min": 0.0, "num_pts": SIZE}
        told = {
            "func_type": 1,
            "id1": "Force",
            "ord_data_type": 4,
            "ordinate_axis_units_lab": "N",
        }

        def write(path: Path) -> None:
            one = pyuff.prepare_58(binary=binary, data=FORCE, x=TIME, **kinds, **places, **entities, **spaced, **told)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves its file to the collector
                pyuff.UFF(str(path)).write_sets(one, mode="add")
                gc.collect()

        return write

    header = {"Unit": "N", "SignalName": "Force", "SampleFrequency": RATE}
    testlab = {"x_values": {"start_value": 0.0, "increment": 1.0 / RATE}, "y_values": {"values": FORCE}}
    return {
        "vector.mat": mat(Force=FORCE, Fs=RATE),
        "row.mat": mat(F=FORCE[None, :], t=TIME[None, :]),
        "testlab.mat": mat(Signal=testlab),
        "structure.mat": mat(data={"time": TIME, "force": FORCE, "Fs": RATE}),
        "picoscope.mat": mat(Tstart=0.0, Tinterval=1.0 / RATE, Length=SIZE, Version="6.14", A=FORCE[:, None]),
        "dewesoft.mat": mat(Sample_rate=RATE, Data1_time_Force=TIME[:, None], Data1_Force=FORCE[:, None]),
        "catman.mat": mat(Channel_1_Data=TIME, Channel_2_Data=FORCE[:, None], Channel_2_Header=header),
        "cwru.mat": mat(X097_DE_time=FORCE[:, None], X097RPM=np.array([[1200]])),
        "matlab-7-3.mat": matlab_7_3,
        "group.h5": hdf_group,
        "times.h5": lambda path: hdf(path, time=TIME, force=FORCE),
        "16-bit.wav": wav((share * 32767).astype(np.int16)),
        "float.wav": wav(FORCE.astype(np.float32)),
        "8-bit.wav": wav(np.clip(share * 127 + 128, 0, 255).astype(np.uint8)),
        "stereo.wav": wav((half * 32767).astype(np.int16)),
        "32-bit.wav": wav((share * 2147483647).astype(np.int32)),
        "24-bit.wav": sound("WAV"),
        "24-bit.flac": sound("FLAC"),
        "channel.tdms": tdms,
        "channel.mf4": mdf("4.10"),
        "channel.mdf": mdf("3.30"),
        "mdf.csv": mdf_text(units=False),
        "mdf-units.csv": mdf_text(units=True),
        "second-sheet.xlsx": excel,
        "times.parquet": parquet(force=FORCE, time=TIME),
        "instants.parquet": parquet(force=FORCE, at=pa.array([at(k) for k in range(SIZE)], pa.timestamp("ns"))),
        "channel.uff": universal(0),
        "channel-binary.uff": universal(1),
    }
