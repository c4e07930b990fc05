"""Binary files and tables in memory: what comes back, what is left out, what is refused."""

import io
import struct
import time
import wave

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import scipy.sparse
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.signals.raw import RawTable, library_errors
from robustpolish.signals.read import UNIVERSAL, raw_table, read_measurement
from robustpolish.signals.readers.arrays import table_of
from robustpolish.signals.readers.mat import DamagedFileError, check_heaps, readable_variables
from tests.signals.records import FORCE, MOTION, TIME, UNITS, check, csv, uff_record


@pytest.mark.parametrize(
    ("shape", "options"), [((-1, 1), {}), ((1, -1), {}), ((-1, 1), {"format": "4"})]
)
def test_mat(tmp_path, shape, options):
    path = tmp_path / "data.mat"
    content = {"t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6}
    content = {k: v.reshape(shape) for k, v in content.items()} | {"gain": 3.0}
    scipy.io.savemat(path, content, **options)
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


def cells(*items):
    content = np.empty(len(items), dtype=object)
    content[:] = items
    return content


def test_mat_cells_and_nested_structs(tmp_path):
    path = tmp_path / "data.mat"
    content = {"rig": {"daq": {"t": TIME, "F": FORCE / 1e3}, "c": cells(MOTION * 1e6, "a", 3.0)}}
    scipy.io.savemat(path, content)
    data = read_measurement(path, units={"F": "kN", "rig/c{1}": "um"})
    check(data.rename({"rig/daq/F": "F", "rig/c{1}": "x"}))


def test_mat_matrix_with_names_in_a_cell(tmp_path):
    path = tmp_path / "data.mat"
    table = np.column_stack([TIME, FORCE / 1e3, MOTION * 1e6])
    scipy.io.savemat(path, {"data": table, "names": cells("t", "F [kN]", "x [um]")})
    check(read_measurement(path))


def test_mat_structs_by_number(tmp_path):
    path = tmp_path / "data.mat"
    runs = np.array([(TIME, FORCE), (TIME, 2 * FORCE)], dtype=[("t", object), ("F", object)])
    scipy.io.savemat(path, {"run": runs})
    second = read_measurement(path, table="run(2)")
    np.testing.assert_allclose(second["F"], 2 * FORCE)
    with pytest.raises(InvalidInputError, match=r"table=, one of run\(1\), run\(2\)"):
        read_measurement(path)


def test_mat_of_version_7_3_with_cells(tmp_path):
    path = tmp_path / "data.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        parts = {"a": TIME, "b": FORCE / 1e3, "c": MOTION * 1e6}
        for name, values in parts.items():
            file[f"#refs#/{name}"] = values.reshape(1, -1)
        for name, text in (("d", "t"), ("e", "F")):
            file[f"#refs#/{name}"] = np.array([[ord(letter)] for letter in text], np.uint16)
            file[f"#refs#/{name}"].attrs["MATLAB_class"] = np.bytes_("char")
        references = [file[f"#refs#/{name}"].ref for name in "abc"]
        file.create_dataset("data", data=np.array(references, dtype=h5py.ref_dtype))
        words = [file[f"#refs#/{name}"].ref for name in "de"]
        file.create_dataset("names", data=np.array(words, dtype=h5py.ref_dtype))
    data = read_measurement(
        path, rename={"data{1}": "t", "data{2}": "F", "data{3}": "x"}, units=UNITS
    )
    check(data)
    assert data.attrs["notes"] == ["left out, as they are no signals: names"]


def mat_content(compressed=False, **variables):
    file = io.BytesIO()
    scipy.io.savemat(file, variables, do_compression=compressed)
    return file.getvalue()


GOOD_MAT = mat_content(x=np.arange(5.0))


def changed_mat(place, new):
    return GOOD_MAT[:place] + new + GOOD_MAT[place + len(new) :]


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        (changed_mat(126, b"XX"), "no byte order"),
        (changed_mat(128, struct.pack("<I", 9)), "an element of type 9 among the variables"),
        (changed_mat(132, struct.pack("<I", 10_000)), "larger than the file"),
        (GOOD_MAT[:132], "ends in the middle"),
        (changed_mat(136, struct.pack("<I", 5)), "without its flags"),
        (changed_mat(152, struct.pack("<I", 6)), "without its dimensions"),
        (changed_mat(160, struct.pack("<i", -1)), "impossible dimensions"),
        (changed_mat(160, struct.pack("<i", 7)), "data do not fill it"),
    ],
)
def test_what_contradicts_itself_is_damaged(bad, told):
    with pytest.raises(DamagedFileError, match=told):
        readable_variables(bad)


def test_compressed_elements_have_to_be_whole():
    whole = mat_content(True, x=np.arange(500.0))
    size = struct.unpack_from("<I", whole, 132)[0]
    cut = whole[:132] + struct.pack("<I", size - 20) + whole[136:-20]
    with pytest.raises(DamagedFileError, match="not complete"):
        readable_variables(cut)
    with pytest.raises(DamagedFileError, match="compressed element is damaged"):
        readable_variables(whole[:136] + b"\xff" * 8 + whole[144:])


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


def test_groups_are_tables(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        for run, motion in (("run1", MOTION), ("run2", 2 * MOTION)):
            for name, values in (("time", TIME), ("F", FORCE), ("x", motion)):
                file[f"{run}/daq/{name}"] = values
            file[f"{run}/daq/F"].attrs["units"] = "N"
            file[f"{run}/daq/x"].attrs["unit"] = "m"
    check(read_measurement(path, table="run1/daq"))
    direct = read_measurement(path, time="run1/daq/time", columns=["run1/daq/F", "run1/daq/x"])
    check(direct.rename({"run1/daq/F": "F", "run1/daq/x": "x"}))
    listed = r"file holds run1/daq/F \(400\), run1/daq/time \(400\), .*table=, one of run1/daq, "
    with pytest.raises(InvalidInputError, match=listed):
        read_measurement(path)
    with pytest.raises(InvalidInputError, match=r"'F' in several groups, .*run1/daq/F, run2/daq/F"):
        read_measurement(path, time="run1/daq/time", columns=["F"])
    with pytest.raises(InvalidInputError, match=r"table: got 'run3', .* holds run1/daq/F \(400\)"):
        read_measurement(path, table="run3")


def test_what_one_group_holds_goes_by_its_own_name(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        for name, values in (("time", TIME), ("F", FORCE / 1e3), ("x", MOTION * 1e6)):
            file[f"measurement/{name}"] = values
    check(read_measurement(path, columns=["F", "x"], units=UNITS))


@pytest.fixture
def heap_file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["x"] = np.arange(5.0), np.array([0.0, 1.0, 0.5, 2.0, 1.0])
        file["words"] = [f"word {i}" for i in range(300)]
    return path


def damaged(path, place, number):
    """Write a number as the length that stands at a place of the first heap."""
    content = bytearray(path.read_bytes())
    start = content.index(b"GCOL\x01")
    content[start + place : start + place + 8] = struct.pack("<Q", number)
    path.write_bytes(content)


@pytest.mark.parametrize("number", [10**6, 2**63, 2**64 - 1])
@pytest.mark.parametrize("place", [8, 24])  # of the heap, of its first object
def test_impossible_sizes_are_refused(heap_file, place, number):
    with heap_file.open("rb") as file:
        check_heaps(file)
    damaged(heap_file, place, number)
    with pytest.raises(rp.InvalidInputError, match="heap"):
        rp.read_measurement(heap_file)


def test_what_takes_no_room_would_never_end(heap_file):
    path = heap_file
    content = bytearray(path.read_bytes())
    start = content.index(b"GCOL\x01")
    content[start + 16 : start + 32] = bytes(16)
    path.write_bytes(content)
    with pytest.raises(rp.InvalidInputError, match="an object of an impossible"):
        rp.read_measurement(path)


def test_data_in_other_files_are_not_followed(tmp_path):
    (tmp_path / "secret").write_bytes(np.arange(5.0).tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("t", data=np.arange(5.0))
        file.create_dataset("x", (5,), "f8", external=[(str(tmp_path / "secret"), 0, 40)])
    with pytest.raises(rp.InvalidInputError, match="lies in another file"):
        rp.read_measurement(tmp_path / "a.h5")


def test_the_size_of_texts_is_bounded(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"], file["x"] = np.arange(5.0), np.array([0.0, 1.0, 0.5, 2.0, 1.0])
        file.create_dataset("words", (10**7,), h5py.string_dtype(), chunks=(10**6,))
    with pytest.raises(rp.InvalidInputError, match="more texts"):
        rp.read_measurement(tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["words"] = ["a" * 1000, *["b"] * 1000]
    with pytest.raises(rp.InvalidInputError, match="unpacked"):
        rp.read_measurement(tmp_path / "b.h5", max_bytes=100_000)


def test_npz_with_columns_and_tables(tmp_path):
    path = tmp_path / "data.npz"
    np.savez(path, t=TIME, F=FORCE / 1e3, x=MOTION * 1e6)
    check(read_measurement(path, units=UNITS))
    table = np.column_stack([TIME, FORCE / 1e3, MOTION * 1e6])
    np.savez(path, columns=np.array(["t", "F", "x"]), a=table, b=2 * table)
    check(read_measurement(path, table="a", units=UNITS))
    with pytest.raises(InvalidInputError, match="a, b"):
        read_measurement(path)
    with pytest.raises(InvalidInputError, match=r"a \(400 x 3\), b \(400 x 3\)"):
        read_measurement(path, table="c")


def sorted_out(chosen=None, **arrays):
    return table_of(arrays, chosen, "a.npz")


@pytest.mark.parametrize(
    ("name", "value", "rate"),
    [("fs", 500.0, 500.0), ("Ts", 0.002, 500.0), ("fs", -1.0, None), ("gain", 3.0, None)],
)
def test_a_lone_number_may_be_the_rate(name, value, rate):
    assert sorted_out(x=np.arange(3.0), **{name: np.array([[value]])}).sampling_rate == rate


def test_a_matrix_is_a_table_whose_columns_may_have_names():
    matrix = np.arange(8.0).reshape(4, 2)
    assert list(sorted_out(m=matrix).columns) == ["m_1", "m_2"]
    lying = sorted_out(m=matrix.T, columns=np.array(["t", "x [mm]"]))
    np.testing.assert_array_equal(lying.columns["x"], matrix[:, 1])
    assert lying.units == {"x": "mm"}


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
        {"F": ("time", FORCE / 1e3, {"units": "kN"}), "x": ("time", MOTION * 1e6, {"units": "um"})},
        {"time": ("time", TIME * 1e3, {"units": "ms"})},
    )
    check(read_measurement(data))
    check(read_measurement(read_measurement(data)))
    single = read_measurement(data["x"])
    np.testing.assert_allclose(single["x"], MOTION)


# What the head of a file says of its body, in each format: used, told, or the file is refused.


def uff(path, head, rows, points, kind=2, even=1, start=0.0, axis="s"):
    """Write a data set 58 by hand: rows of six numbers, with what its head announces."""
    cards = ["    -1", "    58", "x", "NONE", "NONE", "NONE", "NONE"]
    cards.append(f"{head:5}{0:10}{0:5}{0:10} {'x':>10}{2:10}{1:4} {'F':>10}{1:10}{1:4}")
    cards.append(f"{kind:10}{points:10}{even:10}{start:13.5e}{1e-3:13.5e}{0:13.5e}")
    for unit in (axis, "um", "N", "NONE"):
        cards.append(f"{0:10}{0:5}{0:5}{0:5} {'NONE':20} {unit:20}")
    cards += ["".join(f"{v:13.5e}" for v in rows[i : i + 6]) for i in range(0, len(rows), 6)]
    path.write_text("\n".join([*cards, "    -1", ""]))
    return path


def test_uff_has_the_points_it_announces(tmp_path):
    pytest.importorskip("pyuff")
    path = tmp_path / "data.unv"
    found = read_measurement(uff(path, 1, [*MOTION[:25] * 1e6, 0, 0, 0, 0, 0], 25, start=5.0))
    np.testing.assert_allclose(found["x"], MOTION[:25], rtol=1e-4)
    assert float(found["time"][0]) == 5.0
    in_ms = read_measurement(uff(path, 1, MOTION[:24] * 1e6, 24, axis="ms"))
    assert float(in_ms["time"][1]) == pytest.approx(1e-6)
    with pytest.raises(InvalidInputError, match="2000 points announced, 24 there"):
        read_measurement(uff(path, 1, MOTION[:24], 2000))
    lines, H = np.array([5.0, 5.3, 6.1, 7.7, 9.2]), np.arange(1, 6) - 1j
    curve = [*np.c_[lines, H.real, H.imag].ravel(), 0, 0, 0]
    got = rp.read_frequency_response(uff(path, 4, curve, 5, kind=5, even=0, axis="rad/s"))
    np.testing.assert_allclose(got["frequency"], lines / (2 * np.pi))
    np.testing.assert_allclose(got.values.ravel(), H * 1e-6)


def tdms(path, **second):
    nptdms = pytest.importorskip("nptdms")
    head = {"wf_increment": 1e-3, "wf_start_time": np.datetime64("2024-05-03T12:00:00.000000")}
    x = np.interp(TIME + second.pop("late", 0.0), TIME, MOTION)
    with nptdms.TdmsWriter(path) as writer:
        first = nptdms.ChannelObject("rig", "F", FORCE, {**head, "unit_string": "N"})
        other = nptdms.ChannelObject("rig", "x", x, {**head, "unit_string": "m", **second})
        writer.write_segment([first, other])
    return path


@pytest.mark.parametrize(
    "start",
    [
        {"wf_start_time": np.datetime64("2024-05-03T12:00:00.100000")},
        {"wf_start_offset": 0.1},
        {"wf_start_time": np.datetime64("2024-05-03T11:59:59.900000"), "wf_start_offset": 0.2},
    ],
)
def test_tdms_channels_are_put_on_one_clock(start, tmp_path):
    data = read_measurement(tdms(tmp_path / "a.tdms", late=0.1, **start))
    assert data.sizes["time"] == 300
    np.testing.assert_allclose(data["F"], FORCE[100:])
    np.testing.assert_allclose(data["x"], MOTION[100:], atol=1e-12)
    since_first_clock = 0.2 if start.get("wf_start_offset") == 0.2 else 0.1
    assert float(data["time"][0]) == pytest.approx(since_first_clock)
    assert "0.1 s apart" in data.attrs["notes"][0]


@pytest.mark.parametrize(
    ("second", "told"),
    [
        ({"wf_start_offset": 0.1234}, "starts 0.1234 s"),
        ({"wf_start_offset": 77.0}, "starts 77 s"),
        ({"wf_increment": 2e-3}, "F: 1000 Hz, x: 500 Hz"),
    ],
)
def test_tdms_channels_that_do_not_fit_are_refused(second, told, tmp_path):
    with pytest.raises(InvalidInputError, match=told):
        read_measurement(tdms(tmp_path / "a.tdms", **second))


def test_a_tdms_file_that_was_cut_off_says_so(tmp_path):
    path = tdms(tmp_path / "a.tdms")
    path.write_bytes(path.read_bytes()[:-800])
    assert "cut off" in read_measurement(path).attrs["notes"][0]


def test_a_wav_file_that_was_cut_off_says_so(tmp_path):
    path = tmp_path / "a.wav"
    scipy.io.wavfile.write(path, 1000, MOTION)
    path.write_bytes(path.read_bytes()[:-800])
    assert any("300 samples are there" in note for note in read_measurement(path).attrs["notes"])


def test_hdf5_attributes_of_a_channel_are_used(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.round(MOTION * 1e7).astype(np.int16)
        file["x"].attrs.update(units="um", fs=1000.0, scale_factor=0.1)
        file["F"] = np.round(FORCE).astype(np.int16)
        file["F"].attrs.update(units="N", dt=1e-3, add_offset=5.0, _FillValue=np.int16(9999))
        file["F"][7] = 9999
    data = read_measurement(path)
    np.testing.assert_allclose(data["time"], TIME, atol=1e-12)
    np.testing.assert_allclose(data["x"], MOTION, atol=1e-7)
    np.testing.assert_allclose(data["F"], FORCE + 5, atol=2)  # the gap is filled in
    with h5py.File(path, "a") as file:
        file["x"].attrs.update(fs=500.0)
    with pytest.raises(InvalidInputError, match="x: 500 Hz"):
        read_measurement(path)


def test_units_of_matlab_variables(tmp_path):
    path = tmp_path / "a.mat"
    names, units = (np.array(n, dtype=object) for n in (["t", "F", "x"], ["s", "kN", "um"]))
    table = np.column_stack([TIME, FORCE / 1e3, MOTION * 1e6])
    scipy.io.savemat(path, {"m": table, "names": names, "units": units})
    check(read_measurement(path))
    scipy.io.savemat(path, {"t": TIME, "F": FORCE / 1e3, "F_unit": "kN", "x": MOTION})
    assert read_measurement(path)["F"].attrs["units"] == "N"
    scipy.io.savemat(path, {"F": FORCE, "fs": 1000.0, "dt": 2e-3})
    with pytest.raises(InvalidInputError, match="one sampling rate"):
        read_measurement(path)


@pytest.mark.parametrize("save", [scipy.io.savemat, lambda path, d: np.savez(path, **d)])
def test_a_rate_that_contradicts_the_time_is_told(save, tmp_path):
    path = tmp_path / ("a.mat" if save is scipy.io.savemat else "a.npz")
    save(path, {"t": TIME, "x": MOTION, "fs": 500.0})
    assert "gives 500 Hz: the steps are used" in read_measurement(path).attrs["notes"][0]


# What is read is checked and converted, and every kind of bad file refused.


def test_columns_can_be_chosen(tmp_path):
    path = tmp_path / "data.csv"
    constant = csv("time [ms],F [kN],x [um],T [degC]", columns=[
        TIME * 1e3, FORCE / 1e3, MOTION * 1e6, 0 * TIME + 20,
    ])  # fmt: skip
    path.write_text(constant)
    # what stands still may be an input, as a constant load is
    assert "T: 293.15 throughout" in read_measurement(path).attrs["notes"]
    chosen = read_measurement(path, columns=["F"], optional=["x", "y"])
    assert [*chosen.data_vars] == ["F", "x"]
    check(read_measurement(path, columns=["F", "x"]))
    with pytest.raises(InvalidInputError, match=r"no channel 'y'.*F, x, T"):
        read_measurement(path, columns=["y"])


def test_units_can_be_given_and_calibrated(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(csv("t,F,x", columns=[TIME, FORCE / 1e3, MOTION / 2.5e-3]))
    check(read_measurement(path, units={"F": "kN", "x": "2.5 mm"}))
    with pytest.raises(InvalidInputError, match="units"):
        read_measurement(path, units={"q": "mm"})


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


def test_what_is_no_measurement_is_refused(tmp_path):
    other = tmp_path / "data.doc"
    other.write_text("x")
    for source in (tmp_path, tmp_path / "missing.csv", other, 3, None, [1, 2], {"x": [1]}):
        with pytest.raises(InvalidInputError, match="measurement"):
            read_measurement(source)
    with pytest.raises(InvalidInputError, match=r"data\.doc.*\.csv.*\.mat"):
        read_measurement(other)


def table(*names):
    raw = RawTable()
    for name in names:
        raw.add(name, [1.0, 2.0])
    return raw


def test_a_name_is_used_once_and_a_unit_in_the_file_goes_before_the_header():
    table = RawTable()
    table.add("x [mm]", [1.0], "um")
    assert table.units == {"x": "um"}
    with pytest.raises(InvalidInputError, match="column: got 'x', expected a name used once"):
        table.add("x", [2.0])


def test_columns_go_by_name_by_header_and_by_the_end_of_their_path():
    raw = table("x [mm]", "a/F", "a/y", "b/y")
    assert [raw.resolve("column", name) for name in ("x", "x [mm]", "F")] == ["x", "x", "a/F"]
    with pytest.raises(InvalidInputError, match=r"'y' in several groups, expected .* a/y, b/y"):
        raw.resolve("column", "y")
    with pytest.raises(InvalidInputError, match=r"no channel 'q', expected .* x, a/F, a/y, b/y"):
        raw.resolve("column", "q")


def test_columns_can_change_places():
    raw = table("x [mm]", "y", "F [kN]")
    raw.columns["y"] = [3.0, 4.0]
    raw.rename({"x [mm]": "y", "y": "x"})
    assert raw.columns == {"y": [1.0, 2.0], "x": [3.0, 4.0], "F": [1.0, 2.0]}
    assert raw.units == {"y": "mm", "F": "kN"}
    for names in ({"x": "y"}, {"x": ""}, {"x": 3}, {"q": "z"}):
        with pytest.raises(InvalidInputError, match="rename"):
            raw.rename(names)


def test_a_library_s_complaint_is_told_in_one_line():
    for error, reason in ((ValueError("first\nsecond"), "first"), (KeyError(), "KeyError")):
        told = rf"a\.wav \({reason}\)"
        with pytest.raises(InvalidInputError, match=told), library_errors("a.wav", "WAV"):
            raise error


@pytest.mark.parametrize("suffix", [".csv", ".TXT", ".tsv", ".dat", ".asc", ".lvm"])
def test_text_tables_go_by_many_suffixes(suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    path.write_text(csv())
    raw = raw_table(path)
    assert (list(raw.columns), raw.units["x"]) == (["time", "F", "x"], "um")
    with pytest.raises(InvalidInputError, match="the file has but one"):
        raw_table(path, "rig")


def test_universal_files_go_by_several_suffixes(tmp_path):
    pytest.importorskip("pyuff")
    for suffix in UNIVERSAL:
        path = tmp_path / f"a{suffix}"
        path.write_text("nothing of the kind\n")
        with pytest.raises(InvalidInputError, match="measurement"):
            raw_table(path)


# Tables in text as data loggers, LabVIEW, R, MATLAB, spreadsheets and people write them.


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
