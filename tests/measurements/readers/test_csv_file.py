"""Tables in text, as different programs write them."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, TIME, check, csv


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
