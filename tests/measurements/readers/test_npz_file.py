"""NumPy archives."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, TIME, UNITS, check


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
