"""Every format in, with the same content, and every kind of bad file refused."""

import wave
from collections import Counter

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import scipy.sparse
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from robustpolish.errors import InvalidInputError
from robustpolish.measurements import read_measurement

TIME = np.arange(400) / 1000
FORCE = 2e3 * np.sin(2 * np.pi * 7 * TIME)  # N
MOTION = 1e-3 * np.cos(2 * np.pi * 5 * TIME)  # m


def check(data, rtol=1e-9):
    np.testing.assert_allclose(data["time"], TIME, atol=1e-9)
    np.testing.assert_allclose(data["F"], FORCE, rtol=rtol, atol=1e-6)
    np.testing.assert_allclose(data["x"], MOTION, rtol=rtol, atol=1e-12)
    assert (data["F"].attrs["units"], data["x"].attrs["units"]) == ("N", "m")
    assert data["time"].attrs["units"] == "s"


def csv(header="time [ms],F [kN],x [um]", separator=",", columns=None, comma=False):
    columns = [TIME * 1e3, FORCE / 1e3, MOTION * 1e6] if columns is None else columns
    rows = [separator.join(repr(float(v)) for v in row) for row in zip(*columns, strict=True)]
    text = "\n".join([header.replace(",", separator), *rows]) + "\n"
    return text.replace(".", ",") if comma else text


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_csv(tmp_path, suffix, separator, encoding):
    path = tmp_path / f"data{suffix}"
    path.write_text(csv(separator=separator), encoding=encoding)
    check(read_measurement(path))
    assert read_measurement(str(path)).attrs["source"] == str(path)


def test_csv_with_decimal_commas_remarks_and_latin_units(tmp_path):
    path = tmp_path / "data.csv"
    text = "# made in Delft\n\n" + csv("time [ms];F [kN];x [µm]", ";", comma=True)
    path.write_text(text, encoding="latin-1")
    check(read_measurement(path))


def test_csv_with_a_header_behind_a_hash(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("# " + csv())
    check(read_measurement(path))


def test_columns_can_be_chosen(tmp_path):
    path = tmp_path / "data.csv"
    constant = csv("time [ms],F [kN],x [um],T [degC]", columns=[
        TIME * 1e3, FORCE / 1e3, MOTION * 1e6, 0 * TIME + 20,
    ])  # fmt: skip
    path.write_text(constant)
    with pytest.raises(InvalidInputError, match=r"T: got 20 throughout"):
        read_measurement(path)
    check(read_measurement(path, columns=["F", "x"]))
    with pytest.raises(InvalidInputError, match=r"no channel 'y'.*F, x, T"):
        read_measurement(path, columns=["y"])


def test_units_can_be_given_and_calibrated(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(csv("t,F,x", columns=[TIME, FORCE / 1e3, MOTION / 2.5e-3]))
    check(read_measurement(path, units={"F": "kN", "x": "2.5 mm"}))
    with pytest.raises(InvalidInputError, match="units"):
        read_measurement(path, units={"q": "mm"})


UNITS = {"F": "kN", "x": "um"}


@pytest.mark.parametrize("shape", [(-1, 1), (1, -1)])
def test_mat(tmp_path, shape):
    path = tmp_path / "data.mat"
    content = {"t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6}
    scipy.io.savemat(path, {k: v.reshape(shape) for k, v in content.items()} | {"gain": 3.0})
    check(read_measurement(path, units=UNITS))


def test_mat_structs_and_sampling_rate(tmp_path):
    path = tmp_path / "data.mat"
    scipy.io.savemat(path, {"m": {"F": FORCE / 1e3, "x": MOTION * 1e6}, "fs": 1000.0})
    data = read_measurement(path, units={"m/F": "kN", "m/x": "um"})
    check(data.rename({"m/F": "F", "m/x": "x"}))


def test_mat_with_what_is_no_signal_and_compressed(tmp_path):
    path = tmp_path / "data.mat"
    content = {
        "t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6,
        "remark": "made in Delft", "empty": np.zeros((0, 0)), "sparse": scipy.sparse.eye(3),
        "cells": np.array([1, "a"], dtype=object), "z": 1 + 2j * TIME,
    }  # fmt: skip
    scipy.io.savemat(path, content, do_compression=True)
    check(read_measurement(path, units=UNITS, columns=["F", "x"]))


def test_mat_of_version_4(tmp_path):
    path = tmp_path / "data.mat"
    content = {"t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6}
    scipy.io.savemat(path, content, format="4")
    check(read_measurement(path, units=UNITS))


def test_mat_of_version_7_3(tmp_path):
    path = tmp_path / "data.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6}.items():
            file[name] = values.reshape(1, -1)
        file["#refs#/a"] = np.zeros(3)
    content = bytearray(path.read_bytes())
    content[:116] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116)
    path.write_bytes(bytes(content))
    check(read_measurement(path, units=UNITS))


def test_hdf5_with_units_in_its_attributes(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("run")
        for name, values, unit in (
            ("time", TIME * 1e3, "ms"),
            ("F", FORCE / 1e3, "kN"),
            ("x", MOTION * 1e6, b"um"),
        ):
            group[name] = values
            group[name].attrs["units"] = unit
        file["remark"] = "made in Delft"
    data = read_measurement(path, time="run/time")
    check(data.rename({"run/F": "F", "run/x": "x"}))


def test_npz_with_columns_and_tables(tmp_path):
    path = tmp_path / "data.npz"
    np.savez(path, t=TIME, F=FORCE / 1e3, x=MOTION * 1e6)
    check(read_measurement(path, units=UNITS))
    table = np.column_stack([TIME, FORCE / 1e3, MOTION * 1e6])
    np.savez(path, columns=np.array(["t", "F", "x"]), a=table, b=2 * table)
    check(read_measurement(path, table="a", units=UNITS))
    with pytest.raises(InvalidInputError, match="a, b"):
        read_measurement(path)
    with pytest.raises(InvalidInputError, match="a, b"):
        read_measurement(path, table="c")


def test_wav(tmp_path):
    path = tmp_path / "data.wav"
    samples = np.column_stack([FORCE / 4e3, MOTION / 4e-3])
    scipy.io.wavfile.write(path, 1000, np.round(samples * 2**15).astype(np.int16))
    data = read_measurement(path, units={"channel_1": "4 kN", "channel_2": "4 mm"})
    data = data.rename(channel_1="F", channel_2="x")
    np.testing.assert_allclose(data["F"], FORCE, atol=4e3 / 2**15)
    np.testing.assert_allclose(data["x"], MOTION, atol=4e-3 / 2**15)
    assert data["x"].attrs["units"] == "m"
    with wave.open(str(path)) as file:
        assert file.getnframes() == data.sizes["time"]


def test_tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "data.tdms"
    with nptdms.TdmsWriter(path) as writer:
        for name, values, unit in (("F", FORCE / 1e3, "kN"), ("x", MOTION * 1e6, "um")):
            properties = {"wf_increment": 1e-3, "unit_string": unit}
            writer.write_segment([nptdms.ChannelObject("rig", name, values, properties)])
    check(read_measurement(path))
    with pytest.raises(InvalidInputError, match="rig"):
        read_measurement(path, table="other")


def uff_record(name, values, unit="NONE"):
    return {
        "type": 58, "binary": 0, "func_type": 1, "id1": name, "data": values, "x": TIME,
        "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "abscissa_spacing": 1,
        "ordinate_axis_units_lab": unit, "orddenom_spec_data_type": 0,
    }  # fmt: skip


def test_uff(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "data.uff"
    records = [uff_record("F", FORCE / 1e3, "kN"), uff_record("x", MOTION * 1e6, "um")]
    pyuff.UFF(str(path)).write_sets(records, mode="overwrite")
    check(read_measurement(path), rtol=1e-5)


def test_pandas_and_xarray():
    frame = pd.DataFrame({"time [ms]": TIME * 1e3, "F [kN]": FORCE / 1e3, "x [um]": MOTION * 1e6})
    check(read_measurement(frame))
    check(read_measurement(frame.set_index("time [ms]")))
    stamped = frame.drop(columns="time [ms]").set_index(
        pd.Timestamp("2024-01-01") + pd.to_timedelta(TIME, unit="s")
    )
    check(read_measurement(stamped))
    data = xr.Dataset(
        {
            "F": ("time", FORCE / 1e3, {"units": "kN"}),
            "x": ("time", MOTION * 1e6, {"units": "um"}),
        },
        {"time": ("time", TIME * 1e3, {"units": "ms"})},
    )
    check(read_measurement(data))
    check(read_measurement(read_measurement(data)))
    single = read_measurement(data["x"])
    np.testing.assert_allclose(single["x"], MOTION)


def test_a_sampling_rate_stands_in_for_time():
    frame = pd.DataFrame({"F [kN]": FORCE / 1e3, "x [um]": MOTION * 1e6})
    with pytest.raises(InvalidInputError, match="sampling_rate"):
        read_measurement(frame)
    check(read_measurement(frame, sampling_rate=1000))


def test_gaps_and_jitter_leave_a_note(tmp_path):
    path = tmp_path / "data.csv"
    keep = np.arange(400) != 200
    path.write_text(csv(columns=[TIME[keep] * 1e3, FORCE[keep] / 1e3, MOTION[keep] * 1e6]))
    data = read_measurement(path)
    assert data.attrs["notes"] == ["1 missing sample filled in at 1 place, by cubic interpolation"]
    np.testing.assert_allclose(data["F"], FORCE, atol=1e-3 * np.ptp(FORCE))


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
    "nothing": (line(7, "6.0,,3.0"), "line 8.*nothing"),
    "short line": (line(7, "6.0,1.0"), "line 8.*2 columns"),
    "nan": (line(7, "6.0,nan,3.0"), r"F: got nan at sample 6 \(0.006 s\)"),
    "infinity": (line(7, "6.0,inf,3.0"), "F: got inf"),
    "time runs back": (line(7, "1.0,1.0,3.0"), "after"),
    "unknown unit": (csv("time [ms],F [kQ],x [um]"), "kQ"),
    "time in metres": (csv("time [mm],F [kN],x [um]"), "unit of time"),
    "same name": (csv("time [ms],F [kN],F [um]"), "F"),
    "no time": (csv("a [ms],F [kN],x [um]"), "sampling_rate"),
    "constant": (csv(columns=[TIME * 1e3, FORCE * 0 + 1, MOTION]), "F: got 1 throughout"),
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


def test_what_is_no_measurement_is_refused(tmp_path):
    other = tmp_path / "data.doc"
    other.write_text("x")
    for source in (tmp_path, tmp_path / "missing.csv", other, 3, None, [1, 2], {"x": [1]}):
        with pytest.raises(InvalidInputError, match="measurement"):
            read_measurement(source)


SUFFIXES = [".csv", ".mat", ".h5", ".npz", ".wav", ".tdms", ".uff"]


@pytest.fixture(scope="module")
def good_files(tmp_path_factory):
    """One small good file of each format, to be damaged."""
    folder = tmp_path_factory.mktemp("good")
    (folder / "a.csv").write_text(csv())
    scipy.io.savemat(folder / "a.mat", {"t": TIME, "x": MOTION})
    with h5py.File(folder / "a.h5", "w") as file:
        file["t"], file["x"] = TIME, MOTION
    np.savez(folder / "a.npz", t=TIME, x=MOTION)
    scipy.io.wavfile.write(folder / "a.wav", 1000, (MOTION * 1e7).astype(np.int16))
    nptdms, pyuff = pytest.importorskip("nptdms"), pytest.importorskip("pyuff")
    with nptdms.TdmsWriter(folder / "a.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("g", "x", MOTION, {"wf_increment": 1e-3})])
    pyuff.UFF(str(folder / "a.uff")).write_sets([uff_record("x", MOTION)], mode="overwrite")
    return {path.suffix: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.filterwarnings("ignore")  # the file libraries warn of what they find in damaged files
def test_damaged_files_end_in_a_message_or_are_read(good_files, tmp_path):
    outcomes = Counter()

    @settings(max_examples=150, deadline=None, derandomize=True)
    @given(st.data())
    def damaged(data):
        outcomes[read_damaged(good_files, tmp_path, data)] += 1

    damaged()
    # What is hardly damaged is read, what is cut or random is not: neither may be the only answer.
    assert outcomes["read"] >= 15
    assert outcomes["refused"] >= 50


def read_damaged(good_files, tmp_path, data):
    suffix = data.draw(st.sampled_from(SUFFIXES))
    content = bytearray(good_files[suffix])
    kind = data.draw(st.sampled_from(["cut", "change", "random", "insert"]))
    if kind == "cut":
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    elif kind == "random":
        content = bytearray(data.draw(st.binary(max_size=300)))
    else:
        for _ in range(data.draw(st.integers(1, 5))):
            place = data.draw(st.integers(0, min(len(content) - 1, 1500)))
            new = data.draw(st.binary(min_size=1, max_size=4))
            content[place : place + (0 if kind == "insert" else len(new))] = new
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(bytes(content))
    try:
        result = read_measurement(path, sampling_rate=data.draw(st.sampled_from([None, 1000.0])))
    except InvalidInputError:
        return "refused"
    assert result.sizes["time"] >= 2
    return "read"
