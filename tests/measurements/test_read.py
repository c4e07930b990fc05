"""What is read is checked and converted, and every kind of bad file refused."""

from collections import Counter

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from robustpolish.errors import InvalidInputError
from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, TIME, check, csv, uff_record


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
