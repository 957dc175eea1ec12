"""Replicas of what newer recorders write, made from their makers' published descriptions: one periodic force each.

    python -m tests.recordings.recorder_shapes

writes each and judges it without a further word: 120 cycles of 20 Hz, to ±0.2 N. ``SHAPES`` has a writer for each kind;
the comment above it names the recorder, or the program, whose manual or whose own files show the form.
"""

import datetime
import io
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

RATE, CYCLE = 2000.0, 20.0
SIZE = 12_000
TIME = np.arange(SIZE) / RATE
_PHASE = TIME * CYCLE % 1.0
FORCE = np.where((_PHASE > 0.3) & (_PHASE < 0.5), 40.0 * np.sin(np.pi * (_PHASE - 0.3) / 0.2), 0.0)
FORCE = FORCE + np.random.default_rng(3).uniform(-0.2, 0.2, SIZE)
START = datetime.datetime(2022, 4, 12, 13, 32, 10)
SHAPES: dict[str, Callable[[], str | bytes]] = {}


def shape(name: str) -> Callable[[Callable[[], str | bytes]], Callable[[], str | bytes]]:
    """Enter a writer under the name of its file."""

    def entered(write: Callable[[], str | bytes]) -> Callable[[], str | bytes]:
        SHAPES[name] = write
        return write

    return entered


def rows(form: str, several: int = 1, end: str = "\n") -> str:
    """Lines of instants ``t`` and forces ``f``, of the ``i``-th sample, at ``d``; every so many samples one."""
    return "".join(
        form.format(
            i=place // several,
            t=TIME[place],
            ms=1e3 * TIME[place],
            us=round(1e6 * TIME[place]),
            f=FORCE[place],
            d=START + datetime.timedelta(microseconds=round(1e6 * TIME[place])),
        )
        + end
        for place in range(0, SIZE, several)
    )


def at(place: int) -> datetime.datetime:
    """Instant of a sample."""
    return START + datetime.timedelta(microseconds=round(1e6 * TIME[place]))


@shape("lecroy.csv")
def lecroy() -> str:
    """Teledyne LeCroy WaveSurfer."""
    head = "LECROYWS3054,51200,Waveform\nSegments,1,SegmentSize,12000\nSegment,TrigTime,TimeSinceSegment1\n"
    return head + "#1,12-Apr-2022 13:32:10,0\nTime,Ampl\n" + rows("{t:.8f},{f:.5f}")


@shape("tektronix-mso.csv")
def tektronix() -> str:
    """Tektronix MSO of series 4 to 6."""
    head = "Model,MSO54\nFirmware Version,1.28.6\nWaveform Type,ANALOG\nPoint Format,Y\nHorizontal Units,s\n"
    head += (
        "Horizontal Scale,0.6\nHorizontal Delay,0\nSample Interval,5e-04\nRecord Length,12000\nGating,0.0% to 100.0%\n"
    )
    head += "Probe Attenuation,1\nVertical Units,V\nVertical Offset,0\nVertical Scale,10\nVertical Position,0\n"
    head += ",\n,\n,\nLabel,\n"
    return head + "TIME,CH1\n" + rows("{t:.6e},{f:.5f}")


@shape("rigol-mso.csv")
def rigol() -> str:
    """Rigol MSO5000: no column of times, their start and step in the heading."""
    return "CH1V,t0 =-6.000000e-03s, tInc = 5.000000e-04,\n" + rows("{f:.6e},,")


@shape("rohde-schwarz.csv")
def rohde_schwarz() -> str:
    """Rohde & Schwarz RTB2000."""
    return "in s,CH1 in V\n" + rows("{t:.8E},{f:.5E}")


@shape("yokogawa.csv")
def yokogawa() -> str:
    """Yokogawa DL850."""
    head = '"Model Name","DL850"\n"BlockNumber",1\n"TraceName","CH1"\n"BlockSize",12000\n"VUnit","N"\n'
    head += '"SampleRate",2.0000000E+03\n"HResolution",5.0000000E-04\n"HOffset",0.0\n"HUnit","s"\n'
    head += '"DisplayBlockSize",12000\n"DisplayPointNo.",1\n"PhaseShift",0\n'
    head += '"Date","2022/04/12"\n"Time","13:32:10.00000000"\n\n'
    return head + rows(",{f:.6E},")


@shape("hantek.csv")
def hantek() -> str:
    """Hantek DSO5000."""
    return "#CHANNEL:CH1\n#CLOCK=500.00uS\n#SIZE=12000\n#UNITS:V\n\n" + rows("{f:.4f}")


@shape("gw-instek.csv")
def gw_instek() -> str:
    """GW Instek GDS-1000B."""
    head = "Format,2.0A,\nMemory Length,12000,\nTrigger Address,6000,\nTrigger Level,2.0E-01,\nSource,CH1,\n"
    head += "Vertical Units,V,\nVertical Units Div,0,\nVertical Scale,1.0E+01,\nProbe Type,0,\nHorizontal Units,S,\n"
    head += "Horizontal Scale,6.0E-01,\nHorizontal Mode,Main,\nSampling Period,5.000E-04,\nWaveform Data,\n"
    return head + rows("{f:.4f},")


@shape("infiniium.csv")
def infiniium() -> str:
    """Keysight Infiniium."""
    head = "Revision:,0\nType:,Raw\nStart:,0\nPoints:,12000\nCount:,1\nXDispRange:,6.0\nXInc:,5.0E-04\nXOrg:,0\n"
    return head + "YData range:,40\nYData center:,20\nX Units:,second\nY Units:,Volt\nData:,\n" + rows("{f:.6E}")


@shape("picoscope.csv")
def picoscope() -> str:
    """PicoScope 7."""
    return "Time,Channel A\n(s),(V)\n\n" + rows("{t:.8f},{f:.8f}")


@shape("saleae.csv")
def saleae() -> str:
    """Saleae Logic 2."""
    return "Time [s],Channel 0\n" + rows("{t:.9f},{f:.6f}")


@shape("phyphox.csv")
def phyphox() -> str:
    """phyphox, force sensor on a telephone's Bluetooth."""
    return '"Time (s)","Force (N)"\n' + rows("{t:.9E},{f:.9E}")


@shape("phyphox-de.csv")
def phyphox_german() -> str:
    """phyphox with tabulators and decimal commas."""
    return '"Zeit (s)"\t"Kraft (N)"\n' + rows("{t:.9E}\t{f:.9E}").replace(".", ",")


@shape("phyphox-acceleration.csv")
def phyphox_acceleration() -> str:
    """phyphox, acceleration: the axes and their absolute value."""
    axes = ",".join(f'"Linear Acceleration {axis} (m/s^2)"' for axis in "xyz")
    return f'"Time (s)",{axes},"Absolute acceleration (m/s^2)"\n' + rows("{t:.9E},{f:.6E},0.01,0.02,{f:.6E}")


@shape("sensor-logger.csv")
def sensor_logger() -> str:
    """Sensor Logger on a telephone: nanoseconds since 1970, and seconds."""
    lines = rows("{d},{t:.7f},{f:.5f}").splitlines()
    zero = int(START.replace(tzinfo=datetime.UTC).timestamp())
    stamped = (f"{zero * 10**9 + round(1e9 * t)},{line.split(',', 1)[1]}" for t, line in zip(TIME, lines, strict=True))
    return "time,seconds_elapsed,force\n" + "\n".join(stamped) + "\n"


@shape("physics-toolbox.csv")
def physics_toolbox() -> str:
    """Physics Toolbox, whose clock has colons before the milliseconds; 200 readings a second."""
    lines = rows("{d:%H:%M:%S}:{d:%f},{f:.5f}", 10).splitlines()
    return "time,gFx\n" + "".join(f"{line[:12]}{line[15:]}\n" for line in lines)


@shape("arduino-monitor.txt")
def arduino_monitor() -> str:
    """Serial monitor of the Arduino IDE with time stamps; 200 readings a second."""
    return "".join(f"{line[:12]} -> {line[15:]}\n" for line in rows("{d:%H:%M:%S.%f}{f:.3f}", 10).splitlines())


@shape("arduino-millis.csv")
def arduino_millis() -> str:
    """A sketch that prints ``millis()``; 200 readings a second."""
    return "millis,force_N\n" + rows("{ms:.0f},{f:.3f}", 10)


@shape("arduino-labels.txt")
def arduino_labels() -> str:
    """Labelled values, as the Arduino plotter reads them."""
    return rows("t_us:{us},force:{f:.3f}")


@shape("esp-idf.log")
def esp_idf() -> str:
    """Log of ESP-IDF, with milliseconds since the start; 200 readings a second."""
    return rows("I ({ms:.0f}) adc: force={f:.3f}", 10)


@shape("lines.jsonl")
def json_lines() -> str:
    """One JSON object a reading, as MQTT loggers write."""
    return rows('{{"t_us": {us}, "force_N": {f:.4f}}}')


@shape("table.json")
def json_table() -> str:
    """JSON with a list a column."""
    return json.dumps({"rate_hz": RATE, "unit": "N", "force": FORCE.round(4).tolist()})


@shape("campbell-toa5.dat")
def campbell() -> str:
    """Campbell Scientific TOA5; 100 readings a second are the CR1000X's, 2,000 those of burst tables."""
    head = '"TOA5","CR6","CR6","1234","CR6.Std.10","CPU:rig.CR6","5678","Burst"\n"TIMESTAMP","RECORD","Force"\n'
    return head + '"TS","RN","N"\n"","","Smp"\n' + rows('"{d:%Y-%m-%d %H:%M:%S.%f}",{i},{f:.4f}')


@shape("hobo.csv")
def hobo() -> str:
    """Onset HOBO, several readings within a second; 200 a second."""
    head = '"Plot Title: rig"\n"#","Date Time, GMT+02:00","Force, N (LGR S/N: 10, SEN S/N: 10, LBL: F)"\n'
    return head + rows("{i},{d:%m/%d/%y %I:%M:%S} PM,{f:.3f}", 10)


@shape("hioki.csv")
def hioki() -> str:
    """Hioki Memory HiCorder."""
    head = '"File name","AUTO0001.MEM"\n"Title comment",""\n"Trigger Time","\'22-04-12 13:32:10"\n"CH","U1-1"\n'
    head += '"Mode","Voltage"\n"Range","100V"\n"UnitID","V"\n"Comment",""\n"Scaling","OFF"\n"Ratio","1"\n"Offset","0"\n'
    return head + '"Time","U1-1[V]"\n' + rows("{t:.9E},{f:.6E}")


@shape("labview.lvm")
def labview() -> str:
    """National Instruments' text of measurements (LVM)."""
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    head += "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tAbsolute\nOperator\trig\nDate\t2022/04/12\n"
    head += "Time\t13:32:10.1234\n***End_of_Header***\t\n\t\nChannels\t1\t\nSamples\t12000\t\nDate\t2022/04/12\t\n"
    head += "Time\t13:32:10.1234\t\nY_Unit_Label\tN\t\nX_Dimension\tTime\t\nX0\t0.0000000000000000E+0\t\n"
    head += "Delta_X\t5.000000E-4\t\n***End_of_Header***\t\t\nX_Value\tForce\tComment\n"
    return head + rows("{t:.6f}\t{f:.6f}\t")


@shape("daqami.csv")
def daqami() -> str:
    """Measurement Computing DAQami."""
    head = "Device Serial Number:,01D3A2\nSample Rate:,2000\nNumber of Samples:,12000\n\n"
    return head + 'Sample,Date/Time,"Force (N)",Events\n' + rows("{i},{d:%m/%d/%Y %I:%M:%S.%f} PM,{f:.4f},")


@shape("flexlogger.csv")
def flexlogger() -> str:
    """NI FlexLogger."""
    return "Time,Force (N)\n" + rows("{d:%m/%d/%Y %H:%M:%S.%f},{f:.5f}")


@shape("twincat-scope.csv")
def twincat() -> str:
    """Beckhoff TwinCAT Scope."""
    head = "Name;Scope Project\nFile;rig.svdx\nStarttime of export;132942619300000000;12.04.2022 13:32:10\n"
    head += "Endtime of export;132942619360000000;12.04.2022 13:32:16\n\nName;Force\nSymbolComment;\nData-Type;REAL64\n"
    head += (
        "SampleTime[ms];0,5\nVariableSize;8\nSymbolBased;True\nSymbolName;MAIN.fForce\nNetID;5.12.34.56.1.1\nPort;851\n"
    )
    return head + "Offset;0\nScaleFactor;1\nUnit;N\n" + rows("{ms:.1f};{f:.4f}").replace(".", ",")


@shape("rockwell-trend.csv")
def rockwell() -> str:
    """Rockwell Studio 5000 trend; 100 readings a second are its fastest, a tenth of the rate here."""
    head = '"Controller Name","Rig"\n"Trend Name","T1"\n"Trend Tags","1"\n"Sample Period","5 ms"\n'
    head += '"Start Time","04/12/2022 13:32:10;000"\n"Stop Time","04/12/2022 13:32:16;000"\n'
    head += '"Header:","Date","Time","Force"\n'
    lines = rows('"Data:","{d:%m/%d/%Y}","{d:%H:%M:%S};{d:%f}",{f:.4f}', 10).splitlines()
    return head + "".join(line[:34] + line[37:] + "\n" for line in lines)


@shape("siemens-trace.csv")
def siemens() -> str:
    """Siemens TIA Portal, trace."""
    head = "Trace;Rig\nRecording time;12.04.2022 13:32:10\nSampling;OB30 500 us\n\n"
    return (
        head
        + "Sample;Time [us];Force\n"
        + rows("{i};{us};{f:.4f}").replace(".", ",").replace("12,04,2022", "12.04.2022")
    )


@shape("halsampler.txt")
def halsampler() -> str:
    """LinuxCNC's halsampler -t: number and value, without a rate; its user names the columns."""
    return "time_us force\n" + rows("{us} {f:.6f}")


@shape("date-and-time.csv")
def date_and_time() -> str:
    """A logger with date and time in two columns, decimal comma."""
    lines = rows("{d:%d.%m.%Y};{d:%H:%M:%S},{d:%f};{f:.4f}").splitlines()
    return "Datum;Uhrzeit;Kraft [N]\n" + "".join(line[:27] + line[27:].replace(".", ",") + "\n" for line in lines)


@shape("excel-days.csv")
def excel_days() -> str:
    """Days since 1899, as spreadsheets keep instants."""
    zero = (START - datetime.datetime(1899, 12, 30)) / datetime.timedelta(days=1)
    return "Date,Force [N]\n" + "".join(
        f"{zero + t / 86400.0:.12f},{f:.4f}\n" for t, f in zip(TIME, FORCE, strict=True)
    )


@shape("one-row.csv")
def one_row() -> str:
    """All readings in one long row, with their rate before."""
    return "sample rate [Hz],2000\n" + ",".join(f"{f:.4f}" for f in FORCE) + "\n"


@shape("two-rows.csv")
def two_rows() -> str:
    """A row of times and a row of forces, each with its name."""
    times, forces = (",".join(f"{v:.5f}" for v in column) for column in (TIME, FORCE))
    return f"time [s],{times}\nforce [N],{forces}\n"


@shape("two-blocks.csv")
def two_blocks() -> str:
    """A recorder that was started twice: a block, a blank line, its heading and a short block again."""
    head = "Time [s],Force [N]\n"
    short = "".join(f"{t:.5f},{f:.4f}\n" for t, f in zip(TIME[:400], FORCE[:400], strict=True))
    return head + rows("{t:.5f},{f:.4f}") + "\n" + head + short


@shape("arrays.npz")
def arrays() -> bytes:
    """NumPy's archive of arrays."""
    file = io.BytesIO()
    np.savez(file, force=FORCE, fs=RATE)
    return file.getvalue()


@shape("compressed.npz")
def compressed() -> bytes:
    """The same, compressed, with times."""
    file = io.BytesIO()
    np.savez_compressed(file, time=TIME, force=FORCE)
    return file.getvalue()


@shape("endaq.csv")
def endaq() -> str:
    """enDAQ (Mide) shock recorder, one axis."""
    return '"Time","X (100g)"\n' + rows("{t:.6f},{f:.5f}")


@shape("labjack.dat")
def labjack() -> str:
    """LabJack LJStreamM."""
    head = "Time\tv0\ty0\n"
    return head + rows("{t:.6f}\t{f:.6f}\t{f:.6f}")


@shape("comments.txt")
def comments() -> str:
    """Columns between blanks, named in a comment, as numpy.savetxt and many laboratories write."""
    return "# rig 3, sensor 1\n# time[s] force[N]\n" + rows("{t:.6f}   {f:12.5f}")


def judged(path: Path) -> str:
    """Empty if a file is told periodic by its 119 cycles of 50 ms without a further word, else what is said of it."""
    from chaosgym.errors import ChaosgymError
    from chaosgym.recordings.runs import judged_files

    try:
        run = judged_files(str(path))[0].runs[0]
    except ChaosgymError as error:
        return str(error)
    verdict = run.verdict.diagnosis
    right = (run.kind, verdict.nature, verdict.period) == ("series", "periodic", 1)
    if right and "if the cycle is 50 ms" in verdict.condition and 110 <= len(run.peaks) <= 120:
        return ""
    return f"{run.kind}, {len(run.peaks)} cycles: {verdict.words}; {run.notes[0]}"


def main() -> None:
    """Print what is said of each replica that is not judged rightly, and how many are."""
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, write in SHAPES.items():
            path, content = Path(folder) / name, write()
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
            if told := judged(path):
                failed += 1
                print(f"{name}: {told.replace(folder, '')[:300]}")
    print(f"{len(SHAPES) - failed} of {len(SHAPES)} are read and judged without a further word", file=sys.stdout)


if __name__ == "__main__":
    main()
