import numpy as np
import pytest

from robustpolish.identification.free_runs import output_error


def test_the_figures_are_those_of_their_definitions():
    y = 3.0 + np.sin(np.arange(400) / 7)
    e = 0.1 * np.random.default_rng(0).standard_normal(400)
    found = output_error("x", "m", y, y - e)
    assert (found.name, found.unit) == ("x", "m")
    assert found.rmse == pytest.approx(np.sqrt(np.mean(e**2)))
    assert found.nrmse == pytest.approx(np.linalg.norm(e) / np.linalg.norm(y - y.mean()))
    assert found.relative == pytest.approx(np.linalg.norm(e) / np.linalg.norm(y))
    assert found.band[0] < 0.1 < found.band[1]


def test_a_run_that_diverged_and_a_signal_that_stands_still():
    y, run = np.sin(np.arange(100) / 7), np.full(100, np.inf)
    assert output_error("x", "m", y, run).rmse == np.inf
    still = output_error("x", "m", np.zeros(100), np.zeros(100))
    assert (still.nrmse, still.rmse, still.band) == (0.0, 0.0, (0.0, 0.0))
    assert output_error("x", "m", np.zeros(100), y).nrmse == np.inf
