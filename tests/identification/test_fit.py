"""Least squares of free runs against closed forms and dense solvers."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.fit.least_squares import (
    Fit,
    Residuals,
    covariance_of,
    fit,
    normal_of,
)
from robustpolish.identification.fit.parameters import FreeParameter
from robustpolish.identification.fit.result import stderr_from_covariance
from robustpolish.identification.observer.runs import Runner, StartedPiece, rest
from robustpolish.identification.record import record_of
from tests.identification.oscillators import of_rig, oscillator, record, rig

STIFFNESS, DAMPING = "spring[0].stiffness", "damper[0].damping"
NOISE = 2.0
DATA = of_rig(5000, NOISE, damping=-4.0)
X = np.column_stack([DATA["x"], DATA["v"]])
Y = DATA["f"].values
KNOWN = np.linalg.lstsq(X, Y, rcond=None)[0]


def number(key, start, lower=-np.inf, upper=np.inf, prior=np.inf, centre=0.0):
    return FreeParameter(key, start, 7.0, lower, upper, prior, centre)


def fitted(*free):
    """A fit of the rig, whose force is linear in its numbers."""
    model = rig(30.0, 1.0)
    held = record_of(model, DATA)
    runner = Runner(model, held.dt, 1.0)
    return fit(Residuals(model, [StartedPiece(held, rest(model))], runner, free))


def test_a_linear_fit_is_that_of_the_textbook():
    found = fitted(number(STIFFNESS, 30.0), number(DAMPING, 1.0))
    values, errors = found.model.parameters, stderr_from_covariance(covariance_of(found))
    np.testing.assert_allclose([values[STIFFNESS], values[DAMPING]], KNOWN, rtol=1e-8)
    left = np.mean((Y - X @ KNOWN) ** 2)
    assert found.rmse == pytest.approx(np.sqrt(left), rel=1e-6)
    textbook = np.sqrt(np.diag(np.linalg.inv(X.T @ X)) * left)
    # white residuals scatter by 1 / sqrt(5000) at each of 199 lags
    inflated = textbook * np.sqrt(1 + 2 * 199 / 5000)
    # and the scores of 20 blocks, the larger of the two
    scores = (X * (Y - X @ KNOWN)[:, None]).reshape(20, 250, 2).sum(axis=1)
    inverse = np.linalg.inv(X.T @ X)
    of_blocks = np.sqrt(np.diag(inverse @ np.cov(scores.T) @ inverse * 20))
    expected = np.maximum(inflated, of_blocks)
    np.testing.assert_allclose([errors[STIFFNESS], errors[DAMPING]], expected, rtol=0.02)
    assert np.all(expected < 1.5 * textbook)  # the noise is white


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


def with_smoothed_starts(model, data, *cuts):
    held = record_of(model, data)
    return held, [StartedPiece(held.part(a, b), rest(model)) for a, b in pairwise(cuts)]


def normal_at_rest(prior=np.inf):
    """Normal equations of an oscillator in three windows that start at rest."""
    model = oscillator(stiffness=380.0)
    held, pieces = with_smoothed_starts(
        model, record(1500, start=(0.02, -0.3), noise=0.01), 0, 300, 900, 1500
    )
    free = [
        FreeParameter(STIFFNESS, 380.0, 380.0, 0.0, np.inf, prior, 400.0),
        FreeParameter(DAMPING, 1.0, 0.5, 0.0, np.inf),
    ]
    sizes = np.array([0.02, 0.4])
    residuals = Residuals(model, pieces, Runner(model, held.dt, 0.02), free, sizes)
    x = np.array([1.0, 2.0])
    errors = residuals.errors(x, np.zeros((3, 2)))
    sigma = np.array([3e-3])
    return normal_of(residuals, errors, sigma), residuals, x, (errors / sigma).ravel()


def dense(normal):
    """The same Jacobian with all unknowns side by side: parameters, then starts piece by piece."""
    columns = np.zeros((len(normal.J), 6))
    for i, (block, rows) in enumerate(zip(normal.blocks, normal.rows, strict=True)):
        columns[rows, 2 * i : 2 * i + 2] = block
    return np.hstack([normal.J, columns])


@pytest.mark.parametrize("damping", [0.0, 1e-3, 10.0])
@pytest.mark.parametrize("prior", [np.inf, 5.0])
def test_a_step_is_that_of_dense_least_squares(damping, prior):
    normal, residuals, x, error = normal_at_rest(prior)
    full = dense(normal)
    pulls = np.zeros((2, 8))
    pulls[0, 0], pulls[1, 1] = residuals.prior
    rows = np.vstack([full, pulls])
    # Levenberg's damping counts in the size of each column
    damp = np.sqrt(damping) * np.diag(np.sqrt(np.sum(rows**2, axis=0)))
    right = np.concatenate([error, residuals.prior * (x - residuals.centre), np.zeros(8)])
    expected = -np.linalg.lstsq(np.vstack([rows, damp]), right, rcond=None)[0]
    step, moves = normal.step(np.array([True, True]), damping)
    np.testing.assert_allclose(step, expected[:2], rtol=1e-6)
    np.testing.assert_allclose(moves.ravel(), expected[2:], rtol=1e-6)
