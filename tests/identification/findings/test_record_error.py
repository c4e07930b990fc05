"""The errors of records: together in one figure, side by side in a table, and as JSON."""

import numpy as np
import pytest

from robustpolish.identification.free_runs import (
    OutputError,
    RecordError,
    records_content,
    records_table,
)
from robustpolish.identification.observer.runs import Reproducibility


def record(*nrmse, predictable=True):
    outputs = {
        name: OutputError(name, "m", error, 2 * error, (0.0, 1.0), error)
        for name, error in zip("xy", nrmse, strict=True)
    }
    return RecordError(outputs, np.zeros((1, 2)), Reproducibility(predictable, 1.0, None, ""))


RECORDS = {"slow": record(0.3, 0.4), "fast": record(0.1, 0.1, predictable=False)}


def test_outputs_count_alike():
    slow = RECORDS["slow"]
    assert slow.nrmse == pytest.approx(np.sqrt(0.125))
    assert slow.fit_percent == pytest.approx(100 * (1 - np.sqrt(0.125)))


def test_a_table_has_a_row_for_each_output_of_each_of_several():
    (table,) = records_table(RECORDS)
    assert table.rows[1] == ("slow", "y", 60.0, 0.8, "m")
    assert [row[:2] for row in table.rows] == [(r, o) for r in ("slow", "fast") for o in "xy"]
    assert records_table({"alone": RECORDS["slow"]}) == ()


def test_json_has_the_errors_of_one_too():
    found = records_content({"fast": RECORDS["fast"]})
    assert found == {
        "fast": {
            "nrmse": {"x": 0.1, "y": 0.1},
            "fit_percent": pytest.approx(90.0),
            "reproducible": False,
        }
    }
