"""One record that tests write in every format."""

import numpy as np
import xarray as xr

TIME = np.arange(400) / 1000
FORCE = 2e3 * np.sin(2 * np.pi * 7 * TIME)  # N
MOTION = 1e-3 * np.cos(2 * np.pi * 5 * TIME)  # m
UNITS = {"F": "kN", "x": "um"}


def check(data: xr.Dataset, rtol: float = 1e-9) -> None:
    """Whether it has come back, in SI units."""
    np.testing.assert_allclose(data["time"], TIME, atol=1e-9)
    np.testing.assert_allclose(data["F"], FORCE, rtol=rtol, atol=1e-6)
    np.testing.assert_allclose(data["x"], MOTION, rtol=rtol, atol=1e-12)
    assert (data["F"].attrs["units"], data["x"].attrs["units"]) == ("N", "m")
    assert data["time"].attrs["units"] == "s"


def csv(header="time [ms],F [kN],x [um]", separator=",", columns=None, comma=False):
    """Return it as text."""
    columns = [TIME * 1e3, FORCE / 1e3, MOTION * 1e6] if columns is None else columns
    rows = [separator.join(repr(float(v)) for v in row) for row in zip(*columns, strict=True)]
    text = "\n".join([header.replace(",", separator), *rows]) + "\n"
    return text.replace(".", ",") if comma else text


def uff_record(name, values, unit="NONE"):
    """Return a signal as a data set 58."""
    return {
        "type": 58, "binary": 0, "func_type": 1, "id1": name, "data": values, "x": TIME,
        "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1, "abscissa_spacing": 1,
        "ordinate_axis_units_lab": unit, "orddenom_spec_data_type": 0,
    }  # fmt: skip
