"""Replicas of recorders' files that were written after the readers, from memory of the makers' formats.

    python -m tests.recordings.more_shapes

writes each and judges it without a further word, as ``recorder_shapes`` does with its own: 120 cycles of 20 Hz.
``KNOWN`` are of the kinds that recorders have long written, beside those of ``binary_shapes``; ``NEWER`` are of recent
oscilloscopes, telephones, microcontrollers, loggers and controllers. A text is what stands above its rows and how a row
is written; ``ASKED`` state no rate.
"""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.recordings.binary_shapes import binaries
from tests.recordings.recorder_shapes import FORCE, SIZE, TIME, at, judged, rows

ASKED = ("cwru.mat", "micropython.txt")
"""Files that hold no rate, or a first number without a name: a question is right."""


class Text:
    """A text: what stands above, the form of a row, of every so many samples one, what stands below, the encoding."""

    def __init__(self, above: str, form: str, several: int = 1, below: str = "", coded: str = "utf-8", end: str = "\n"):
        self.above, self.form, self.several, self.below, self.coded, self.end = above, form, several, below, coded, end
        self.comma = False

    def decimal_comma(self) -> "Text":
        """The same with decimal commas in its rows."""
        self.comma = True
        return self

    def write(self, path: Path) -> None:
        """Write the file."""
        body = rows(self.form, self.several, self.end)
        body = body.replace(".", ",") if self.comma else body
        path.write_bytes((self.above + body + self.below).encode(self.coded))


def of_rows(above: str, line: Callable[[int], str], several: int = 1) -> Callable[[Path], None]:
    """A text whose rows are written by a function of their place."""
    return lambda path: path.write_text(above + "".join(line(k) + "\n" for k in range(0, SIZE, several)))


TEKTRONIX = (
    "Record_Length,2.500000e+03 Sample_Interval,5.000000e-04 Trigger_Point,0.000e+00 , , , Source,CH2 Vertical_Units,V "
    "Vertical_Scale,1.000000e+01 Vertical_Offset,0.000000e+00 Horizontal_Units,s Horizontal_Scale,2.500000e-02 "
    "Pt_Fmt,Y Yzero,0.000000e+00 Probe_Atten,1.000000e+00 Model_Number,TBS1104 "
    "Serial_Number,C010123 Firmware_Version,FV:v3.27"
)
BESIDE = [setting.replace("_", " ") for setting in TEKTRONIX.split()]
LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tNo\n"
    "Date\t2022/04/12\nTime\t13:32:10,12\n***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t12000\t\nY_Unit_Label\tN\t\n"
    "X_Dimension\tTime\t\nX0\t0,0\t\nDelta_X\t0,000500\t\n***End_of_Header***\t\t\nX_Value\tForce\tComment\n"
)
CATMAN = "catman AP 4.2.1.10\r\nMessBeginn:\t12.04.2022 13:32:10\r\nKanäle:\t2\r\n\r\nZeit\tMX840A_0 hw\r\ns\tN\r\n"
PULSE = "Header Size:\t12\nDecimal Symbol:\t.\nData Type:\tReal\nX-Axis unit:\ts\nX-Axis delta:\t0.0005\n"
PULSE += "Title1:\tForce (N)\n"
SIGLENT = (
    "Record Length,Analog:12000\nSample Interval,Analog:0.0005\nVertical Units,CH1:V\nHorizontal Units,s\nSource,CH1\n"
)
CENT = "Abtastrate: 2000 Hz\tAbtastrate: 2000 Hz\r\n"
KNOWN: dict[str, Text | Callable[[Path], None]] = {
    "tektronix-tds.csv": of_rows(
        "", lambda k: f"{BESIDE[k] if k < len(BESIDE) else ','},,{TIME[k]:.12f},{FORCE[k]: .5f},"
    ),
    "keysight-x.csv": Text("x-axis,1\r\nsecond,Volt\r\n", "{t:.12E},{f:.5E}", end="\r\n"),
    "rigol-ds.csv": Text("X,CH1,Start,Increment,\nSequence,VOLT,-3.000000e+00,5.000000e-04,\n", "{i},{f:.2e},,"),
    "siglent.csv": Text(SIGLENT + "Second,Volt\n", "{t:.10f},{f:.5f}"),
    "picoscope-6.csv": Text("Time,Channel A,Channel B\n(ms),(V),(mV)\n\n", "{ms:.8f},{f:.8f},0.00000000"),
    "catman.asc": Text(CATMAN + CENT, "{t:.5f}\t{f:.5f}", coded="cp1252").decimal_comma(),
    "dewesoft.txt": Text("Data Info\nSample rate:\t2000 Hz\n\n\tTime (s)\tForce (N)\n", "\t{t:.6f}\t{f:.6f}"),
    "iso.csv": Text("Timestamp;Kraft [N]\n", "{d:%Y-%m-%dT%H:%M:%S.%f}Z;{f:.4f}"),
    "epoch-ms.csv": of_rows("timestamp_ms,force\n", lambda k: f"{1649770330000 + 1e3 * TIME[k]:.1f},{FORCE[k]:.4f}"),
    "epoch-s.csv": of_rows("timestamp,force\n", lambda k: f"{1649770330 + TIME[k]:.6f},{FORCE[k]:.4f}"),
    "testlab.txt": Text(
        "Project:\tC:\\rig.lms\nSection:\tSection1\nTime\tForce:2:+Z\ns\tN\nReal\tReal\n", "{t:.6E}\t{f:.6E}"
    ),
    "imc-famos.asc": Text("Kraft_1\n[N]\ndx=5.000000e-04 s\nx0=0 s\n", "{f:.6E}"),
    "thousands.csv": of_rows("Time [s],Force [N]\n", lambda k: f'{TIME[k]:.5f},"{1500 + FORCE[k]:,.3f}"'),
    "thousands-de.csv": of_rows(
        "Zeit [s];Kraft [N]\n",
        lambda k: f"{TIME[k]:.5f};{1500 + FORCE[k]:,.3f}".translate(str.maketrans(",.", ".,")),
    ),
    "overrange.csv": of_rows(
        "Time [s],Force [N]\n", lambda k: f"{TIME[k]:.5f},{'OVR' if k == 3333 else f'{FORCE[k]:.4f}'}"
    ),
    "not-a-number.csv": of_rows(
        "Time [s],Force [N]\n", lambda k: f"{TIME[k]:.5f},{'1.#QNAN' if k == 9000 else f'{FORCE[k]:.4f}'}"
    ),
    "acceleration.csv": Text("Time [s],Acceleration Z [m/s²]\n", "{t:.5f},{f:.4f}"),
    "newtons.csv": Text("Time (seconds),Force (Newtons)\n", "{t:.5f},{f:.4f}"),
    "pounds.csv": Text("Elapsed Time [s],Load [lbf]\n", "{t:.5f},{f:.4f}"),
    "volts.csv": Text("Time [s],AI0 [Volts]\n", "{t:.5f},{f:.4f}"),
    "footer.csv": Text("Time [s];Force [N]\n", "{t:.5f};{f:.4f}", below="\nMax;42.2\nMin;-0.2\n"),
    "units-row.csv": Text("Time,Force,Temp\ns,N,degC\n", "{t:.5f},{f:.4f},21.5"),
    "whole-seconds.csv": Text("Time,Force [N]\n", "{d:%H:%M:%S},{f:.4f}"),
    "graphtec.csv": of_rows(
        "Vendor,Graphtec\nModel,GL840\nSampling,500us\nNO.,Date&Time,ms,CH1\n,,,N\n",
        lambda k: f"{k + 1},{at(k):%Y/%m/%d %H:%M:%S},{at(k).microsecond / 1000:.1f},{FORCE[k]:+.3f}",
    ),
    "pulse.txt": Text(PULSE, "{i}\t{t:.7E}\t{f:.6E}"),
    "dasylab.asc": Text("DASYLab - V 11.00.00\nDelta: 0,0005 s\nMesszeit[s];Kraft 0 [N]\n", "{t:.4f};{f:.4f}"),
    "mescope.txt": Text("ME'scopeVES\nTime\tM#1\nsec\tN\n", "{t:.6f}\t{f:.6f}"),
    "instron.csv": Text('"Time","Load","Extension"\n"(s)","(N)","(mm)"\n', '"{t:.4f}","{f:.4f}","0.1000"'),
    "mts.txt": Text("MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\nTime\tAxial Force\nSec\tN\n", "{t:.6f}\t{f:.7f}"),
    "unicode.txt": Text("Zeit (s)\tKraft (N)\r\n", "{t:.5f}\t{f:.4f}", coded="utf-16", end="\r\n").decimal_comma(),
    "labview.lvm": Text(LVM, "\t{f:.6f}").decimal_comma(),
    "semicolons.csv": Text("Zeit;Kraft\ns;N\n", "{t:.5f};{f:.4f}").decimal_comma(),
    "pandas.csv": Text(",Time [s],Force [N]\n", "{i},{t},{f}"),
    "pandas-instants.csv": Text(",force\n", "{d},{f}"),
    "heading-again.csv": of_rows(
        "Time [s],Force [N]\n", lambda k: "Time [s],Force [N]\n" * (k == 5000) + f"{TIME[k]:.5f},{FORCE[k]:.4f}"
    ),
}
STAMPED = "{d:%Y-%m-%d %H:%M:%S.%f}"
INFLUX = "#group,false,false,true,true,false,false,true,true\n#default,_result,,,,,,,\n"
INFLUX += ",result,table,_start,_stop,_time,_value,_field,_measurement\n"
KEYENCE = (
    '"Model","NR-600"\n"Sampling cycle","500 us"\n"Number of points","12000"\n"No.","Time","(1)HA-V01"\n"","s","V"\n'
)
YOKOGAWA = "Device Type,GM10\nTrigger,\nCh.,,,CH0001\nTag,,,Force\nUnit,,,N\nDate,Time,msec,\n"
WRENCH = ",".join(f"field.wrench.force.{axis}" for axis in "xyz")
NEWER: dict[str, Text | Callable[[Path], None]] = {
    "keysight-two.csv": Text("x-axis,1,2\nsecond,Volt,Volt\n", "{t:.8E},{f:.5E},{f:.4E}"),
    "rigol-dho.csv": Text("Time(s),CH1(V),t0=-3.0s, tInc=0.000500s,,\n", "{t:.6e},{f:.4e},,,,"),
    "tektronix-mdo.csv": Text(
        "Model,MDO3024\n\nHorizontal Units,s,,,,\nSample Interval,5e-04,,,,\nVertical Units,V,,,,\n,,,,,\nLabel,,,,,\n"
        "TIME,CH1\n",
        "{t:.8e},{f:.4f}",
    ),
    "lecroy-hdo.csv": Text(
        "LECROYHDO6054,63001,Waveform\nSegments,1,SegmentSize,12000\nSegment,TrigTime,TimeSinceSegment1\n"
        "#1,12-Apr-2022 13:32:10,0\nTime,Ampl\n",
        "{t:.10f},{f:.6f}",
    ),
    "rohde-schwarz-rto.csv": Text("Time;CH1\ns;V\n", "{t:.8E};{f:.6E}"),
    "owon.csv": Text("Units:(mV)\nCH1\nSample period:,500us\nindex,CH1_Voltage(mV)\n", "{i},{f:.2f}"),
    "siglent-hd.csv": Text("Sample Interval,5.00E-04\nVertical Units,V\nTime,Voltage\n", "{t:.6E},{f:.6E}"),
    "hantek-6022.csv": Text("Time,CH1,CH2\n(ms),(V),(V)\n", "{ms:.3f},{f:.3f},0.000"),
    "androsensor.csv": of_rows(
        "ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);Time since start in ms ;YYYY-MO-DD HH-MI-SS_SSS\n",
        lambda k: f"{FORCE[k]:.4f};0.01;{1e3 * TIME[k]:.0f};{at(k):%Y-%m-%d %H-%M-%S}_{at(k).microsecond // 1000:03d}",
        10,
    ),
    "matlab-mobile.csv": Text("Timestamp,X,Y,Z\n", "{d:%d-%b-%Y %H:%M:%S.%f},{f:.4f},0.02,0.01", 10),
    "physics-toolbox-axes.csv": Text("time,ax,ay,az,aT\n", "{t:.4f},0.01,0.02,{f:.4f},{f:.4f}", 10),
    "phyphox-semicolons.csv": Text(
        '"Zeit (s)";"Beschleunigung x (m/s^2)";"Absolutbeschleunigung (m/s^2)"\n', "{t:.9E};{f:.9E};{f:.9E}"
    ).decimal_comma(),
    "vernier.csv": Text('"Latest: Time (s)","Latest: Force (N)"\n', "{t:.4f},{f:.4f}"),
    "pasco.csv": Text("Time (s) Run #1,Force (N) Run #1\n", "{t:.4f},{f:.4f}"),
    "micropython.txt": Text("MPY: soft reboot\n", "({ms:.0f}, {f:.4f})", 10),
    "teensy-micros.csv": Text("micros,raw,force_N\n", "{us},{i},{f:.3f}"),
    "card-with-clock.csv": Text("date,time,force\n", "{d:%Y-%m-%d},{d:%H:%M:%S},{f:.3f}"),
    "labels-with-units.log": Text("Tare done\n", "t: {ms:.0f} ms, F: {f:.3f} N", 10),
    "coolterm.txt": Text("CoolTerm Capture 2022-04-12 13-32-10\n", STAMPED + "\t{f:.3f}", 10),
    "picolog.csv": Text(',"Channel 1 Last (N)"\n', "{d:%Y-%m-%dT%H:%M:%S.%f}+01:00,{f:.4f}", 10),
    "windaq.csv": Text("Relative Time,CH1\nseconds,N\n", "{t:.6f},{f:.5f}"),
    "keyence.csv": Text(KEYENCE, "{i},{t:.4f},{f:.4f}"),
    "yokogawa-smartdac.csv": of_rows(
        YOKOGAWA, lambda k: f"{at(k):%Y/%m/%d},{at(k):%H:%M:%S},{at(k).microsecond // 1000},{FORCE[k]:.4f}", 10
    ),
    "lascar.csv": Text("EasyLog USB,Time,Force(N),Serial Number\n", "{i},{d:%d/%m/%Y %H:%M:%S.%f},{f:.3f}", 10),
    "gantner.csv": Text("Timestamp;V1 Force\n;N\n", "{d:%d.%m.%Y %H:%M:%S},{d:%f};{f:.5f}"),
    "codesys.csv": Text("Timestamp;PLC_PRG.fForce\n[us];[N]\n", "{us};{f:.4f}"),
    "automation-studio.csv": Text("(* Trace *)\nTime [us];gForce [N];\n", "{us};{f:.4f};"),
    "siemens-datalog.csv": Text(
        "Record,Date,UTC Time,Force\n", "{i}, {d:%m/%d/%Y}, {d:%H:%M:%S.%f}, {f:.4E}", 10, "//END\n"
    ),
    "universal-robots.csv": Text(
        "timestamp actual_TCP_force_0 actual_TCP_force_1 actual_TCP_force_2\n", "{t:.4f} 0.01 0.02 {f:.4f}", 4
    ),
    "ros-wrench.csv": of_rows(
        f"%time,field.header.seq,field.header.stamp,field.header.frame_id,{WRENCH}\n",
        lambda k: f"{1649770330 * 10**9 + round(1e9 * TIME[k])},{k},{1649770330 * 10**9},ft,{FORCE[k]:.5f},0.0,0.0",
    ),
    "influx.csv": Text(
        INFLUX, ",,0,2022-04-12T13:00:00Z,2022-04-12T14:00:00Z,{d:%Y-%m-%dT%H:%M:%S.%f}Z,{f:.4f},force,rig"
    ),
    "grafana.csv": Text('"Time","force"\n', '"' + STAMPED + '",{f:.4f}'),
    "messages.jsonl": Text("", '{{"ts":"{d:%Y-%m-%dT%H:%M:%S.%f}Z","value":{f:.4f},"unit":"N"}}'),
    "heidenhain.csv": Text(
        "[HEADER]\nSampleTime=0.5 ms\n[DATA]\ntime [ms];I nominal [A];s actual [mm]\n", "{ms:.1f};{f:.4f};0.0"
    ),
    "one-row.txt": lambda path: path.write_text("fs = 2000 Hz\n" + " ".join(f"{f:.4f}" for f in FORCE) + "\n"),
    "rows-with-names.csv": lambda path: path.write_text(
        "\n".join(
            [title + "".join(f",{value:.4f}" for value in v) for title, v in (("Force [N]", FORCE), ("Time [s]", TIME))]
        )
    ),
    "titled-blocks.csv": Text(
        "Run 1\nTime [s],Force [N]\n" + rows("{t:.4f},{f:.4f}")[:6000].rpartition("\n")[0] + "\n\nRun 2\n"
        "Time [s],Force [N]\n",
        "{t:.4f},{f:.4f}",
    ),
    "edge-impulse.json": lambda path: path.write_text(
        json.dumps({"payload": {"interval_ms": 0.5, "sensors": [{"units": "N"}], "values": FORCE[:, None].tolist()}})
    ),
}


def archive(**arrays: object) -> Callable[[Path], None]:
    """An archive of NumPy."""

    def write(path: Path) -> None:
        with path.open("wb") as file:
            np.savez(file, **arrays)

    return write


NEWER |= {
    "data.npz": archive(data=FORCE, sample_rate=2000),
    "times.npz": archive(t=TIME, x=FORCE),
}


def told(path: Path, write: Text | Callable[[Path], None]) -> str:
    """What is said of a replica that is not judged rightly; empty where it is."""
    (write.write if isinstance(write, Text) else write)(path)
    return judged(path)


def main() -> None:
    """Print what is said of each replica that is not judged rightly, and how many are."""
    with tempfile.TemporaryDirectory() as folder:
        for kind, shapes in (("known", KNOWN | binaries()), ("newer", NEWER)):
            answers = {name: told(Path(folder) / name, write) for name, write in shapes.items()}
            for name, answer in answers.items():
                print(f"{name}: {answer.replace(folder, '')[:200]}" if answer else "", end="\n" if answer else "")
            right = sum(not answer for answer in answers.values())
            print(f"{right} of {len(shapes)} {kind} shapes are read and judged without a further word")


if __name__ == "__main__":
    main()
