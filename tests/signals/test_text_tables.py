"""Tables in text as data loggers, LabVIEW, R, MATLAB, spreadsheets and people write them."""

import time

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.read import read_measurement
from tests.signals.records import FORCE, MOTION, TIME, check, csv


def rows(*columns, separator=","):
    return "\n".join(separator.join(row) for row in zip(*columns, strict=True)) + "\n"


def texts(values, form="{!r}"):
    return [form.format(float(value)) for value in values]


T, F, X = texts(TIME * 1e3), texts(FORCE / 1e3), texts(MOTION * 1e6)


CLOCK = [f"{int(t // 1000) + 30:02d}.{round(t) % 1000:03d}" for t in TIME * 1e3]


DAY = ["2024-05-03"] * TIME.size


HEAD = """\
Data Logger GL-840, serial no. 12345
Firmware,2.31
Date,2024-05-03
Channels,3

Remarks: spring changed, 2 kg added
"""


LVM = """\
LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\tOne
Time_Pref\tRelative
Operator\tlab
Date\t2024/05/03
Time\t12:01:07.2186508
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t400\t400\t
Date\t2024/05/03\t2024/05/03\t
Time\t12:01:07.2186508\t12:01:07.2186508\t
Y_Unit_Label\tkN\tum\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t
Delta_X\t1.000000E-3\t1.000000E-3\t
***End_of_Header***\t\t\t
"""


FILES = {
    "logger": HEAD + "Time (ms),F (kN),x (um)\n" + rows(T, F, X),
    "logger with a line of units": HEAD + "Time,F,x\nms,kN,um\n" + rows(T, F, X),
    "units in brackets below": "Time;F;x\n[ms];[kN];[um]\n" + rows(T, F, X, separator=";"),
    "DIN": "t/ms;F/kN;x/µm\n" + rows(T, F, X, separator=";").replace(".", ","),
    "German": "Zeit [ms];F [kN];x [µm]\n" + rows(T, F, X, separator=";").replace(".", ","),
    "German, blanks": "Zeit(ms)  F(kN)  x(um)\n" + rows(T, F, X, separator="  ").replace(".", ","),
    "LabVIEW": LVM + "X_Value\tF [kN]\tx [um]\tComment\n"
    + rows(texts(TIME), F, X, separator="\t"),
    "LabVIEW without times": LVM + "X_Value\tF [kN]\tx [um]\tComment\n"
    + rows([""] * TIME.size, F, X, separator="\t"),
    "pandas": ",Time (ms),F (kN),x (um)\n" + rows(map(str, range(TIME.size)), T, F, X),
    "index": "Nr.,Time (ms),F (kN),x (um)\n" + rows(map(str, range(1, TIME.size + 1)), T, F, X),
    "R": '"time [ms]","F [kN]","x [um]"\n'
    + rows([f'"{i}"' for i in range(1, TIME.size + 1)], T, F, X),
    "MATLAB": "% made by hand\n% t [ms]\tF [kN]\tx [um]\n" + rows(T, F, X, separator="\t"),
    "numpy": "# t F[kN] x[um]\n" + rows(texts(TIME), F, X, separator=" "),
    "gnuplot": "#  time [ms]   F [kN]   x [um]\n" + rows(T, F, X, separator="   "),
    "delimiters at the ends": "time [ms];F [kN];x [um];\n"
    + rows(T, F, X, separator=";").replace("\n", ";\n"),
    "delimiters at the ends of rows": "time [ms];F [kN];x [um]\n"
    + rows(T, F, X, separator=";").replace("\n", ";\n"),
    "spreadsheet": csv() + ",,\n,,\n",
    "status": "time [ms],F [kN],status,x [um]\n" + rows(T, F, ["OK"] * TIME.size, X),
    "ISO": "timestamp,F [kN],x [um]\n" + rows([f"2024-05-03T12:00:{c}" for c in CLOCK], F, X),
    "ISO in zones": "Timestamp;F [kN];x [um]\n"
    + rows([f"2024-05-03 12:00:{c}+02:00" for c in CLOCK], F, X, separator=";"),
    "day and time": "Date,Time,F [kN],x [um]\n" + rows(DAY, [f"12:00:{c}" for c in CLOCK], F, X),
    "day and time, blanks": "Date Time F[kN] x[um]\n"
    + rows(DAY, [f"12:00:{c}" for c in CLOCK], F, X, separator=" "),
    "since 1970": "time,F [kN],x [um]\n" + rows(texts(TIME + 1714737600, "{:.6f}"), F, X),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_files_of_instruments_are_read(name, tmp_path):
    path = tmp_path / "data.lvm"
    path.write_text(FILES[name], encoding="latin-1" if "DIN" in name else "utf-8")
    data = read_measurement(path)
    assert set(data.data_vars) == {"F", "x"}
    shift = float(data["time"][0])
    assert shift == 0
    check(data)


def test_what_was_left_out_or_meant_is_told(tmp_path):
    path = tmp_path / "data.csv"
    for name, note in (
        ("index", "left out: Nr., which numbers the samples"),
        ("status", "left out: status, which is text"),
        ("ISO", "time counts from 2024-05-03T12:00:30.000"),
        ("since 1970", "time counts from its first stamp, 1714737600.000 s"),
    ):
        path.write_text(FILES[name])
        assert note in read_measurement(path).attrs["notes"]


@pytest.mark.parametrize(
    "line",
    [
        "Sampling rate: 1000 Hz", "Sample Rate,1.0 kHz", "# sampling_frequency = 1000",
        "Abtastrate;1000,0;Hz", "Delta_X\t0.001", "Sampling interval: 1 ms", "SampleRate\t1000",
    ],
)  # fmt: skip
def test_the_rate_may_stand_above(line, tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(f"Rig 3\n{line}\n\nF [kN];x [um]\n" + rows(F, X, separator=";"))
    check(read_measurement(path))


def labview(tmp_path, head, shift=0.5, **changed):
    """Write a LabVIEW file with other lines in its head, and read it."""
    text = LVM
    for key, line in changed.items():
        text = "\n".join(line if row.startswith(key) else row for row in text.split("\n"))
    columns = (
        [texts(TIME), F, texts(TIME + shift), X] if head.count("X_") > 1 else [texts(TIME), F, X]
    )
    (tmp_path / "a.lvm").write_text(text + head + "\n" + rows(*columns, separator="\t"))
    return read_measurement(tmp_path / "a.lvm")


PLAIN, TWO = "X_Value\tF\tx\tComment", "X_Value\tF\tX_Value\tx\tComment"


def test_the_head_of_a_labview_file_is_used(tmp_path):
    check(labview(tmp_path, PLAIN))
    check(labview(tmp_path, TWO, shift=0.0))
    words = labview(tmp_path, PLAIN, Y_Unit="Y_Unit_Label\tNewtons\tg")
    assert {k: v.attrs["units"] for k, v in words.items()} == {"F": "N", "x": "m/s^2"}
    assert float(words["x"].max()) == pytest.approx(9.80665e3)
    by_hand = labview(tmp_path, "X_Value\tF [N]\tx", Y_Unit="Y_Unit_Label\tVolts\tum")
    assert by_hand["F"].attrs["units"] == "N"
    short = labview(tmp_path, PLAIN, Samples="Samples\t2000\t2000")
    assert "the head announces 2000 samples, 400 are there" in short.attrs["notes"]
    slow = labview(tmp_path, PLAIN, Delta_X="Delta_X\t0.01\t0.01")
    assert "gives 100 Hz: the steps are used" in slow.attrs["notes"][0]


@pytest.mark.parametrize(
    ("head", "changed", "told"),
    [
        (TWO, {}, "different X_Value"),
        (PLAIN, {"X0": "X0\t0\t0.5"}, "different x0"),
        (PLAIN, {"Delta_X": "Delta_X\t0.001\t0.002"}, "different delta_x"),
    ],
)
def test_labview_channels_on_several_clocks_are_refused(head, changed, told, tmp_path):
    with pytest.raises(InvalidInputError, match=told):
        labview(tmp_path, head, **changed)


def test_empty_cells_are_filled_or_named(tmp_path):
    path = tmp_path / "data.csv"
    force, motion = F.copy(), X.copy()
    force[100] = motion[200] = ""
    motion[201] = "NaN"
    force[0] = motion[-1] = "-"
    path.write_text("time [ms],F [kN],x [um]\n" + rows(T, force, motion))
    data = read_measurement(path)
    assert data.attrs["notes"] == [
        "cut off, as a channel has no value there: the first 1 and the last 1",
        "F: 1 missing value filled in by cubic interpolation (at line 102)",
        "x: 2 missing values filled in by cubic interpolation (at lines 202 to 203)",
    ]
    np.testing.assert_allclose(data["F"], FORCE[1:-1], atol=1e-3 * np.ptp(FORCE))
    motion[150:180] = [""] * 30
    path.write_text("time [ms],F [kN],x [um]\n" + rows(T, force, motion))
    with pytest.raises(InvalidInputError, match=r"x: got 32 missing values, .* lines 152 to 181"):
        read_measurement(path)
    assert read_measurement(path, between=(0.18, 0.39)).attrs["notes"][0].startswith("x: 2 missing")


def test_a_row_of_another_kind_is_named_wherever_it_is(tmp_path):
    path = tmp_path / "data.csv"
    for number in (2, 3, 4, 200):
        for broken, message in (("6.0,fault,3.0", "fault"), ("6.0,1.0", "2 columns")):
            lines = FILES["logger"].splitlines()
            lines[5 + number] = broken
            path.write_text("\n".join(lines))
            with pytest.raises(InvalidInputError, match=f"line {6 + number}.*{message}"):
                read_measurement(path)


def test_numbers_below_remarks_need_names(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("Logger 5\n\n" + rows(T, F, X))
    with pytest.raises(InvalidInputError, match=r"line 3, with numbers only.*header.*3 names"):
        read_measurement(path)


def test_remarks_cost_time_in_proportion(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("# remark, no. 1\n" * 400_000 + csv())
    begin = time.process_time()
    check(read_measurement(path))
    assert time.process_time() - begin < 12  # 25 s when each line was taken off the front


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_csv(tmp_path, suffix, separator, encoding):
    path = tmp_path / f"data{suffix}"
    path.write_text(csv(separator=separator), encoding=encoding)
    check(read_measurement(path))
    assert read_measurement(str(path)).attrs["source"] == str(path)


def line(i, text):
    lines = csv().splitlines()
    lines[i] = text
    return "\n".join(lines) + "\n"


BAD_CSV = {
    "empty": ("", "empty"),
    "blank": ("\n \n", "empty"),
    "header only": ("time [s],x [m]\n", "no numbers"),
    "no header": ("0,1\n1,2\n2,1\n", "header"),
    "text": (line(7, "6.0,fault,3.0"), r"line 8, column 'F \[kN\]'.*fault"),
    "short line": (line(7, "6.0,1.0"), "line 8.*2 columns"),
    "infinity": (line(7, "6.0,inf,3.0"), r"F: got inf at sample 6 \(0.006 s\)"),
    "time runs back": (line(7, "1.0,1.0,3.0"), "after"),
    "unknown unit": (csv("time [ms],F [kQ],x [um]"), "kQ"),
    "time in metres": (csv("time [mm],F [kN],x [um]"), "unit of time"),
    "same name": (csv("time [ms],F [kN],F [um]"), "F"),
    "no time": (csv("a [ms],F [kN],x [um]"), "sampling_rate"),
    "clipped": (csv(columns=[TIME * 1e3, np.clip(FORCE, -1e3, 1e3), MOTION]), "F.*clipped"),
    "nameless": (csv("time [ms],,x [um]"), "name"),
}


@pytest.mark.parametrize("case", BAD_CSV)
def test_bad_tables_are_refused(case, tmp_path):
    text, message = BAD_CSV[case]
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(InvalidInputError, match=message):
        read_measurement(path)
