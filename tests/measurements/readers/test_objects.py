"""Tables that are in memory already."""

import numpy as np
import pandas as pd
import xarray as xr

from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, TIME, check


def test_pandas_and_xarray():
    frame = pd.DataFrame({"time [ms]": TIME * 1e3, "F [kN]": FORCE / 1e3, "x [um]": MOTION * 1e6})
    check(read_measurement(frame))
    check(read_measurement(frame.set_index("time [ms]")))
    stamped = frame.drop(columns="time [ms]").set_index(
        pd.Timestamp("2024-01-01") + pd.to_timedelta(TIME, unit="s")
    )
    check(read_measurement(stamped))
    data = xr.Dataset(
        {
            "F": ("time", FORCE / 1e3, {"units": "kN"}),
            "x": ("time", MOTION * 1e6, {"units": "um"}),
        },
        {"time": ("time", TIME * 1e3, {"units": "ms"})},
    )
    check(read_measurement(data))
    check(read_measurement(read_measurement(data)))
    single = read_measurement(data["x"])
    np.testing.assert_allclose(single["x"], MOTION)
