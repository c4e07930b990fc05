"""LabVIEW files."""

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, check


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
