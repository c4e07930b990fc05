"""What is read is checked and converted, and every kind of bad file refused."""

import numpy as np
import pandas as pd
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.raw import RawTable, library_errors
from robustpolish.signals.read import UNIVERSAL, raw_table, read_measurement
from tests.signals.records import FORCE, MOTION, TIME, check, csv


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
