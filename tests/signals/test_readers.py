"""Binary files and tables in memory: what comes back, what is left out, what is refused."""

import io
import struct
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
from robustpolish.signals.read import read_measurement
from robustpolish.signals.readers.arrays import table_of
from robustpolish.signals.readers.mat import DamagedFileError, check_heaps, readable_variables
from tests.signals.records import FORCE, MOTION, TIME, UNITS, check, uff_record


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
