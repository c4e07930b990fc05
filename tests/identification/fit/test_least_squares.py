from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

from robustpolish.identification.fit.least_squares import (
    Fit,
    Residuals,
    covariance_of,
    fit,
    homotopy,
    normal_of,
    standard_errors,
    stderr_from_covariance,
)
from robustpolish.identification.fit.parameters import FreeParameter
from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.observer.runs import (
    InitialState,
    Runner,
    StartedPiece,
    free_run,
    rest,
)
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.machines.simulation.run import simulate_model
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.oscillators import PLACE, RATE, of_rig, oscillator, record, rig

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


def test_starts_are_fitted_with_the_numbers():
    model, data = oscillator(stiffness=380.0), record(samples=1500, start=(0.02, -0.3))
    held = record_of(model, data)
    pieces = [StartedPiece(held.part(0, 700), rest(model))]
    pieces.append(StartedPiece(held.part(700, 1500), InitialState(np.zeros(2), np.zeros(0))))
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
    errors = stderr_from_covariance(found)
    assert errors["p0"] == pytest.approx(3 / 2, rel=0.1)
    assert errors["p1"] == np.inf
    assert found.sel(parameter="p0", other="p1") == 0


def test_the_number_of_processors_changes_no_bit(monkeypatch):
    case = Case("cubic", one(), [("cubic_stiffness", ("x", "ground"), [4e6])], drive=8.0,
                samples=1500)  # fmt: skip
    (data, _), _ = records(case)
    model = model_of(case).with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 3e6})
    prepared = prepare(model, record_of(model, data), POLICY)
    whole, found = prepared.spans(prepared.everything)[-1:], []
    for processors in (1, 7):
        monkeypatch.setattr("os.cpu_count", lambda processors=processors: processors)
        fits = homotopy(model, prepared, prepared.everything, model, whole, 3)
        found.append((fits[-1].model.parameters, fits[-1].cost))
    assert found[0] == found[1]
    assert found[0][0]["effect[0].stiffness"] == pytest.approx(4e6, rel=0.05)


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


def test_what_is_held_takes_no_step_and_the_rest_goes_on():
    normal, _, _, error = normal_at_rest()
    step, moves = normal.step(np.array([False, True]), 0.0)
    expected = -np.linalg.lstsq(dense(normal)[:, 1:], error, rcond=None)[0]
    assert step[0] == 0.0
    np.testing.assert_allclose(step[1], expected[0], rtol=1e-6)
    np.testing.assert_allclose(moves.ravel(), expected[1:], rtol=1e-6)


def test_what_is_seen_is_what_no_start_can_do():
    normal, _, _, error = normal_at_rest()
    full = dense(normal)
    starts, J = full[:, 2:], full[:, :2]
    expected = J - starts @ np.linalg.lstsq(starts, J, rcond=None)[0]
    np.testing.assert_allclose(normal.seen, expected, atol=1e-8 * np.max(np.abs(J)))
    np.testing.assert_allclose(normal.information(), expected.T @ expected, rtol=1e-6)
    e = error[:, None]
    rest_of = e - full @ np.linalg.lstsq(full, e, rcond=None)[0]
    np.testing.assert_allclose(normal.without_nuisance(e), rest_of, atol=1e-7 * np.max(np.abs(e)))


def test_without_parameters_only_the_starts_move():
    model = oscillator()
    held, pieces = with_smoothed_starts(model, record(600, start=(0.02, -0.3)), 0, 600)
    sizes = np.array([0.02, 0.4])
    found = fit(Residuals(model, pieces, Runner(model, held.dt, 0.02), [], sizes))
    np.testing.assert_allclose(found.pieces[0].start.state, [0.02, -0.3], atol=3e-5)


@pytest.mark.parametrize("kind", ["stribeck_friction", "lugre_friction"])
@pytest.mark.parametrize("seed", range(3))
def test_static_friction_never_ends_below_sliding_friction(kind, seed):
    """The force of the rig has a dip at low speed, which only static below sliding would fit."""
    data = of_rig(1500, 0.5, seed)
    v = data["v"].values
    dip = (3.0 - 2.0 * np.exp(-((v / 1.0) ** 2))) * np.sign(v)
    data = data.assign(f=("time", data["f"].values + dip))
    values = {"force": 2.0, "static_force": 2.5, "velocity": 1.0}
    if kind == "lugre_friction":
        values["stiffness"] = 200.0
    model = rig().with_effect(kind, PLACE, values)
    prepared = prepare(model, record_of(model, data), POLICY)
    fits = homotopy(
        model, prepared, prepared.everything, rig(), prepared.spans(prepared.everything)
    )
    assert fits
    for found in fits:
        numbers = found.model.effects[0].values
        assert numbers["static_force"] >= (1 - 1e-9) * numbers["force"] > 1.0


def test_one_number_stays_above_another_in_its_own_units():
    model = rig().with_effect("stribeck_friction", PLACE)
    held = record_of(model, DATA)
    free = [
        FreeParameter("effect[0].force", 2.0, 4.0, 0.0, np.inf),
        FreeParameter("effect[0].static_force", 3.0, 0.5, 0.0, np.inf, at_least="effect[0].force"),
    ]
    residuals = Residuals(
        model, [StartedPiece(held, rest(model))], Runner(model, held.dt, 1.0), free
    )
    np.testing.assert_allclose(residuals.within(np.array([0.5, 6.0])), [0.5, 6.0])
    np.testing.assert_allclose(residuals.within(np.array([1.0, 6.0])), [1.0, 8.0])
    np.testing.assert_allclose(residuals.within(np.array([-1.0, -6.0])), [0.0, 0.0])


def test_scores_of_blocks_see_what_a_wrong_model_does():
    """Errors whose sign follows the derivative block by block: white to lags, not to scores."""
    random = np.random.default_rng(1)
    seen = random.standard_normal(20_000)
    tide = np.repeat(random.standard_normal(20), 1000)
    errors = seen * tide + 1e-3 * random.standard_normal(20_000)
    fitted = made_up(errors, [float(seen @ seen)])
    plain = covariance_of(fitted).values[0, 0]
    wider = covariance_of(replace(fitted, sensitivity=seen[:, None])).values[0, 0]
    blocks = (seen**2 * tide).reshape(20, 1000).sum(axis=1)
    expected = 20 * np.var(blocks, ddof=1) / float(seen @ seen) ** 2
    assert wider == pytest.approx(expected, rel=0.02)
    assert wider > 100 * plain


def test_each_piece_keeps_the_better_of_two_starts():
    model, held = oscillator(), record_of(oscillator(), record(1200))
    true = free_run(model, held).over(StartedPiece(held, rest(model)), keep=True).states
    pieces = [
        StartedPiece(held.part(k, k + 400), InitialState(true[k], np.zeros(0)))
        for k in (0, 400, 800)
    ]
    residuals = Residuals(model, pieces, Runner(model, held.dt, 1.0), [], np.ones(2))
    right = np.array([piece.start.vector for piece in pieces])
    before, after = right.copy(), right.copy()
    before[0] += 1.0
    after[1] += 1.0
    after[2] = np.nan  # a run that diverges
    given = residuals.errors(np.zeros(0), after)
    starts, errors = residuals.better_starts(np.zeros(0), (before, after), given, np.ones(1))
    np.testing.assert_array_equal(starts, right)
    np.testing.assert_allclose(errors, residuals.errors(np.zeros(0), right), atol=1e-12)


def test_pieces_in_which_friction_holds_do_not_stop_the_fit_of_others():
    """A decay in windows, most of them at rest: their starts say nothing, to first order."""
    model = oscillator(damping=0.5).with_effect("coulomb_friction", PLACE, {"force": 0.4})
    time = np.arange(3000) / RATE
    data = xr.Dataset({"F": ("time", np.zeros(time.size))}, {"time": time})
    true = simulate_model(model, data, [0.02, 0.0], substeps=16)
    random = np.random.default_rng(0)
    noise = 2e-5 * random.standard_normal(time.size)
    held = record_of(model, data.assign(x=("time", true.outputs[:, 0] + noise)))
    wrong = model.with_parameters({"effect[0].force": 0.6})
    starts = true.states + [2e-5, 4e-4] * random.standard_normal(true.states.shape)
    pieces = [
        StartedPiece(held.part(k, k + 60), InitialState(starts[k], np.zeros(0)))
        for k in range(0, 3000, 60)
    ]
    free = [FreeParameter("effect[0].force", 0.6, 0.6, 0.0, np.inf)]
    runner, sizes = Runner(wrong, held.dt, 0.02), np.array([0.02, 0.4])
    found = fit(Residuals(wrong, pieces, runner, free, sizes), 30)
    assert found.rmse[0] < 3e-5  # 1.6e-4 where all starts move together
    assert found.model.parameters["effect[0].force"] == pytest.approx(0.4, rel=0.1)
