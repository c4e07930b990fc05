"""Least squares of free runs against closed forms."""

import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.fit.least_squares import Fit, Residuals, covariance_of, fit
from robustpolish.identification.fit.parameters import FreeParameter
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.observer.runs import Runner, StartedPiece, rest
from robustpolish.identification.record import record_of
from tests.identification.oscillators import of_rig, oscillator, rig

STIFFNESS, DAMPING = "spring[0].stiffness", "damper[0].damping"
NOISE = 2.0
DATA = of_rig(5000, NOISE, damping=-4.0)
X = np.column_stack([DATA["x"], DATA["v"]])
Y = DATA["f"].values


def number(key, start, lower=-np.inf, upper=np.inf, prior=np.inf, centre=0.0):
    return FreeParameter(key, start, 7.0, lower, upper, prior, centre)


def fitted(*free):
    """A fit of the rig, whose force is linear in its numbers."""
    model = rig(30.0, 1.0)
    held = record_of(model, DATA)
    runner = Runner(model, held.dt, 1.0)
    return fit(Residuals(model, [StartedPiece(held, rest(model))], runner, free))


def test_a_prior_pulls_as_an_observation_does():
    found = fitted(number(STIFFNESS, 30.0, prior=0.05, centre=45.0), number(DAMPING, 1.0))
    sigma = float(found.sigma[0])
    rows = np.vstack([X / sigma, [1 / 0.05, 0.0]])
    expected = np.linalg.lstsq(rows, np.append(Y / sigma, 45.0 / 0.05), rcond=None)[0]
    values = found.model.parameters
    assert 45.5 < expected[0] < 49.5  # the prior matters, and so do the data
    np.testing.assert_allclose([values[STIFFNESS], values[DAMPING]], expected, rtol=1e-4)


def test_what_rests_at_a_bound_leaves_the_rest_to_the_others():
    found = fitted(number(STIFFNESS, 30.0), number(DAMPING, 1.0, lower=0.0))
    alone = (X[:, 0] @ Y) / (X[:, 0] @ X[:, 0])
    assert found.model.parameters[DAMPING] == 0.0
    assert found.model.parameters[STIFFNESS] == pytest.approx(alone, rel=1e-8)


def made_up(errors, information, scale=1.0):
    free = [FreeParameter(f"p{j}", 1.0, scale, 0.0, np.inf) for j in range(len(information))]
    columns = errors[:, None]
    return Fit(oscillator(), (), 0.0, columns, np.ones(1), np.diag(information), tuple(free))


def test_coloured_residuals_say_less():
    """An AR(1) of pole r is worth (1 - r^2) / (1 + r^2) of the samples (Bartlett)."""
    white = np.random.default_rng(0).standard_normal(50_000)
    coloured = lfilter([0.6], [1.0, -0.8], white)
    variances = [covariance_of(made_up(e, [400.0])).values[0, 0] for e in (white, coloured)]
    assert variances[0] == pytest.approx(1 / 400, rel=0.02)
    assert variances[1] == pytest.approx(1.64 / 0.36 / 400, rel=0.1)


def test_what_the_data_do_not_see_is_known_not_at_all():
    found = covariance_of(made_up(np.random.default_rng(0).standard_normal(5000), [4.0, 0.0], 3.0))
    errors = stderr_from_covariance(found)
    assert errors["p0"] == pytest.approx(3 / 2, rel=0.1)
    assert errors["p1"] == np.inf
    assert found.sel(parameter="p0", other="p1") == 0
