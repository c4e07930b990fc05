import numpy as np
import pytest

import robustpolish as rp

P = np.array([[4.0, 0.5, 0.0], [0.5, 0.25, 0.01], [0.0, 0.01, 1e-3]])
CENTRE = {"k": 10.0, "c": 1.0, "m": 2.0}


def fit(**changes):
    return rp.uncertain.ellipsoid(CENTRE, **({"covariance": P} | changes))


def test_covariance_gives_the_confidence_region():
    one = fit()
    # The 95 % quantile of chi-square with three degrees of freedom, from any table: 7.815.
    np.testing.assert_allclose(one.L @ one.L.T, 7.814728 * P, rtol=1e-6, atol=1e-12)
    assert np.triu(one.L, 1) == pytest.approx(0)
    samples = np.random.default_rng(0).multivariate_normal(list(CENTRE.values()), P, 4000)
    inside = [one.size(dict(zip(CENTRE, s, strict=True))) <= 1 for s in samples]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.01)


def test_what_a_covariance_calls_certain_is_certain():
    one = rp.uncertain.ellipsoid({"k": 10, "c": 1}, covariance=[[4.0, 0.2], [0.2, 0.01]])
    assert one.L.shape == (2, 1)
    assert (one["c"] / one["k"]).at({"k": 12.0}) == pytest.approx(1.1 / 12)
    with pytest.raises(rp.InvalidInputError, match="can have together"):
        one.directions({"k": 12.0, "c": 0.9})
    both = rp.uncertain.ellipsoid({"k": 10, "g": 3}, covariance=[[4.0, 0.0], [0.0, 0.0]])
    assert both["g"].at({}) == 3.0


def test_result_does_not_depend_on_units():
    units = np.array([1e-9, 1.0, 1e9])
    scaled = rp.uncertain.ellipsoid(
        dict(zip(CENTRE, np.array(list(CENTRE.values())) * units, strict=True)),
        covariance=P * units * units[:, None],
    )
    np.testing.assert_allclose(scaled.L / units[:, None], fit().L, rtol=1e-9)


def test_numbers_and_directions_are_inverse():
    one = fit(name="run 3")
    point = {"k": 11.0, "c": 0.9, "m": 2.01}
    told = one.directions(point)
    assert list(told) == ["run 3[0]", "run 3[1]", "run 3[2]"]
    assert one.numbers(told) == pytest.approx(point)
    assert one.size(point) == pytest.approx(np.linalg.norm(list(told.values())))
    # Each number depends on some of the directions only, and takes points of all of them.
    assert len(one["c"].blocks) == 2
    assert {n: one[n].at(told) for n in one} == pytest.approx(point)
    assert {n: one[n].at(point) for n in one} == pytest.approx(point)


def test_numbers_that_are_not_named_take_what_is_expected_of_them():
    point = fit().numbers(fit().directions({"k": 12.0}))
    # The conditional mean of a normal distribution.
    assert point["c"] == pytest.approx(1 + P[1, 0] / P[0, 0] * 2)
    assert point["m"] == pytest.approx(2 + P[2, 0] / P[0, 0] * 2)


def test_system_of_its_numbers():
    one = fit()
    k, c, m = one["k"], one["c"], one["m"]
    plant = rp.uncertain.system([[0, 1], [-k / m, -c / m]], [[0], [1 / m]], [[1, 0]])
    machine = plant.at({"k": 11.0, "c": 0.9, "m": 2.01})
    np.testing.assert_allclose(machine.A[1], [-11 / 2.01, -0.9 / 2.01])
    assert plant.numbers(one.directions({"k": 11.0}) | {"else": 1})["k"] == pytest.approx(11.0)
    still = plant.at({"ellipsoid[0]": 0.5})
    assert set(still.elements) == {"ellipsoid[1]", "ellipsoid[2]"}
    with pytest.raises(rp.InvalidInputError, match="one way to name a point"):
        plant.at({"k": 11.0, "ellipsoid[0]": 0.5})


def test_samples_lie_evenly_in_the_ellipsoid():
    one = fit()
    matrix = np.array([[1.0], [0], [0]]) * one["k"] + np.array([[0], [1.0], [0]]) * one["c"]
    matrix = matrix + np.array([[0], [0], [1.0]]) * one["m"]
    points = [dict(zip(CENTRE, x.ravel(), strict=True)) for x in matrix.sample(400, seed=1)]
    sizes = np.sort([one.size(point) for point in points])
    assert sizes[-1] <= 1 + 1e-12
    # The share within radius r is r^3.
    assert np.abs(sizes**3 - (np.arange(400) + 0.5) / 400).max() < 0.08


def test_shape_is_taken_as_it_is():
    one = rp.uncertain.ellipsoid({"k": 10.0, "c": 1.0}, [[2.0], [0.1]])
    assert one.ranges == {"k": (8.0, 12.0), "c": (0.9, 1.1)}
    assert one["k"].at({"ellipsoid[0]": 1.5}) == 13.0
    assert one.confidence is None
    assert one["k"].elements["ellipsoid[0]"].group == "ellipsoid"
    assert "direction of the ellipsoid" in str(one["k"])


@pytest.mark.parametrize(
    "call",
    [
        lambda: rp.uncertain.ellipsoid({"k": 1.0}),
        lambda: rp.uncertain.ellipsoid({"k": 1.0}, [[1.0]], covariance=[[1.0]]),
        lambda: rp.uncertain.ellipsoid({}, [[1.0]]),
        lambda: rp.uncertain.ellipsoid({"k": "one"}, [[1.0]]),
        lambda: rp.uncertain.ellipsoid({"k": 1.0}, [[1.0], [2.0]]),
        lambda: rp.uncertain.ellipsoid({"k": 1.0}, covariance=[[-1.0]]),
        lambda: rp.uncertain.ellipsoid({"k": 1.0, "c": 1.0}, covariance=[[1, 2], [2, 1]]),
        lambda: rp.uncertain.ellipsoid({"k": 1.0, "c": 1.0}, covariance=[[1, 0.5], [0, 1]]),
        lambda: rp.uncertain.ellipsoid({"k": 1.0}, covariance=[[1.0]], confidence=95),
        lambda: fit().directions({"stiffness": 1.0}),
        lambda: fit()["k"] + rp.uncertain.ellipsoid({"k": 1.0}, [[1.0]])["k"],
    ],
)
def test_bad_ellipsoids_are_refused(call):
    with pytest.raises(rp.InvalidInputError):
        call()
