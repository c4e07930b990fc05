"""Whether a record can show a mode."""

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.signals.quality import check_sampling

DATA = xr.Dataset({"x": ("time", np.arange(100.0))}, {"time": np.arange(100) * 0.01})


def test_sampling_too_slow_for_a_mode():
    check_sampling(DATA, [49.0])
    with pytest.raises(InvalidInputError, match="mode at 51 Hz"):
        check_sampling(DATA, [3.0, 51.0])
