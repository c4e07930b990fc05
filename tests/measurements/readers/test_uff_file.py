"""Universal files."""

import pytest

from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, check, uff_record


def test_uff(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "data.uff"
    records = [uff_record("F", FORCE / 1e3, "kN"), uff_record("x", MOTION * 1e6, "um")]
    pyuff.UFF(str(path)).write_sets(records, mode="overwrite")
    check(read_measurement(path), rtol=1e-5)
