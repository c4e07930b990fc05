"""Which reader takes what."""

import numpy as np
import pandas as pd
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.sources import UNIVERSAL, raw_table
from tests.measurements.records import csv


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


def test_objects_need_no_file():
    raw = raw_table(pd.DataFrame({"t/ms": [0.0, 1.0], "x (mm)": [2.0, 3.0]}))
    np.testing.assert_array_equal(raw.columns["x"], [2, 3])
    assert raw.units == {"t": "ms", "x": "mm"}


def test_unknown_suffixes_are_refused_with_the_known_ones(tmp_path):
    path = tmp_path / "a.doc"
    path.write_text("x")
    with pytest.raises(InvalidInputError, match=r"a\.doc.*\.csv.*\.mat"):
        raw_table(path)
