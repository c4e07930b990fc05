"""Errors of simulated records."""

import numpy as np
import pytest

from robustpolish.identification.free_runs import free_runs, output_errors, record_errors
from robustpolish.identification.record import record_of
from tests.identification.oscillators import oscillator, record


def test_all_together_and_each_alone():
    """A record of three times the other's length counts three times."""
    small, large = record(500, noise=0.01), record(1500, noise=0.1, seed=1)
    held = record_of(oscillator(), {"small": small, "large": large})
    found = free_runs(oscillator(), held)
    each = record_errors(oscillator(), found)
    assert list(each) == ["small", "large"]
    ours = {name: errors.outputs["x"].rmse for name, errors in each.items()}
    left = small["x"].values - found[0].outputs[:, 0]
    assert ours["small"] == pytest.approx(np.sqrt(np.mean(left**2)))
    together = output_errors(oscillator(), found)["x"].rmse
    assert together**2 == pytest.approx((ours["small"] ** 2 + 3 * ours["large"] ** 2) / 4)
    assert each["large"].reproducibility.reproducible
    assert each["large"].starts.shape == (1, 2)
