import numpy as np
import pytest
from scipy.signal import lfilter

from robustpolish.identification.fit.homotopy import homotopy
from robustpolish.identification.fit.least_squares import (
    Fit,
    Residuals,
    covariance_of,
    errors_from,
    fit,
    standard_errors,
)
from robustpolish.identification.fit.parameters import FreeParameter
from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.observer.kalman import FREE
from robustpolish.identification.observer.run import Runner, Start, StartedPiece, rest
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from tests.hidden_effects.cases import Case, model_of, one, records
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
    values, errors = found.model.parameters, standard_errors(found)
    np.testing.assert_allclose([values[STIFFNESS], values[DAMPING]], KNOWN, rtol=1e-8)
    left = np.mean((Y - X @ KNOWN) ** 2)
    assert found.rmse == pytest.approx(np.sqrt(left), rel=1e-6)
    textbook = np.sqrt(np.diag(np.linalg.inv(X.T @ X)) * left)
    # white residuals scatter by 1 / sqrt(5000) at each of 199 lags
    inflated = textbook * np.sqrt(1 + 2 * 199 / 5000)
    np.testing.assert_allclose([errors[STIFFNESS], errors[DAMPING]], inflated, rtol=0.02)


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


def test_starts_are_fitted_with_the_numbers():
    model, data = oscillator(stiffness=380.0), record(samples=1500, start=(0.02, -0.3))
    held = record_of(model, data)
    pieces = [StartedPiece(held.part(0, 700), rest(model))]
    pieces.append(StartedPiece(held.part(700, 1500), Start(np.zeros(2), np.zeros(0))))
    free = [FreeParameter(STIFFNESS, 380.0, 380.0, 0.0, np.inf)]
    sizes = np.array([0.02, 0.4])
    found = fit(Residuals(model, pieces, Runner(model, held.dt, 0.02), free, sizes), 20)
    assert found.model.parameters[STIFFNESS] == pytest.approx(400.0, rel=1e-4)
    np.testing.assert_allclose(found.pieces[0].start.state, [0.02, -0.3], atol=1e-4)
    assert found.errors.shape == (1500, 1)


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
    errors = errors_from(found)
    assert errors["p0"] == pytest.approx(3 / 2, rel=0.1)
    assert errors["p1"] == np.inf
    assert found.sel(parameter="p0", other="p1") == 0


def test_the_number_of_processors_changes_no_bit(monkeypatch):
    case = Case("cubic", one(), [("cubic_stiffness", ("x", "ground"), [4e6])], drive=8.0,
                samples=1500)  # fmt: skip
    (data, _), _ = records(case)
    model = model_of(case).with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 3e6})
    prepared = prepare(model, record_of(model, data), POLICY)
    found = []
    for processors in (1, 7):
        monkeypatch.setattr("os.cpu_count", lambda processors=processors: processors)
        fits = homotopy(model, prepared, prepared.everything, model, (FREE,), 3)
        found.append((fits[-1].model.parameters, fits[-1].cost))
    assert found[0] == found[1]
    assert found[0][0]["effect[0].stiffness"] == pytest.approx(4e6, rel=0.05)
