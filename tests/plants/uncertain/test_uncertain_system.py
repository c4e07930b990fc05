"""Uncertain numbers, matrices and systems: arithmetic, connections, values and refusals."""

import control
import numpy as np
import pytest

import robustpolish as rp

K, M = rp.uncertain.real("k", 10, percent=40), rp.uncertain.real("m", 2, range=(1, 5))
POINT = {"k": 7.0, "m": 3.0}


@pytest.mark.parametrize(
    "formula",
    [
        lambda k, m: k + m,
        lambda k, m: m * (2 - k),
        lambda k, m: k - 2 * m,
        lambda k, m: -k * m,
        lambda k, m: k / m,
        lambda k, m: 3 / k - m,
        lambda k, m: k / 4 + m,
        lambda k, m: k**3 + m**-2,
        lambda k, m: (1 + k) / (1 + k * m) - k**0,
    ],
)
def test_arithmetic_of_numbers(formula):
    assert formula(K, M).at(POINT) == pytest.approx(formula(7.0, 3.0), rel=1e-12)


def test_with_matrices():
    row = np.array([[1.0, 2.0]])
    np.testing.assert_allclose((K * np.eye(2)).at({"k": 7}), 7 * np.eye(2))
    np.testing.assert_allclose((np.eye(2) * K).at({"k": 7}), 7 * np.eye(2))
    np.testing.assert_allclose((row + K).at({"k": 7}), row + 7)
    np.testing.assert_allclose((K - row).at({"k": 7}), 7 - row)
    np.testing.assert_allclose((row @ (K * np.eye(2))).at({"k": 7}), 7 * row)
    assert (K * np.eye(2)).shape == (2, 2)
    assert (K * row)[0, 1].at({"k": 7}) == 14


def test_with_systems_of_python_control():
    G, s = control.ss([[-1.0]], [[1.0]], [[1.0]], 0), control.tf("s")
    point = 0.7j
    want = 7 * G(point)
    for product in (K * G, G * K, K * control.tf(1, [1, 1]), control.tf(1, [1, 1]) * K):
        assert product.at({"k": 7})(point) == pytest.approx(want)
    assert (G + K).at({"k": 7})(point) == pytest.approx(G(point) + 7)
    assert (1 / (s + 1) - K).at({"k": 7})(point) == pytest.approx(G(point) - 7)
    loop = control.feedback(K * G, 1)
    assert loop.at({"k": 7}).poles() == pytest.approx([-8])
    assert control.series(G, K).at({"k": 7})(point) == pytest.approx(want)
    assert control.parallel(K, G).at({"k": 7})(point) == pytest.approx(G(point) + 7)


def test_nominal_values():
    assert K.nominal == 10
    assert (K * np.eye(2)).nominal.shape == (2, 2)
    assert isinstance((K * control.tf(1, [1, 1])).nominal, control.StateSpace)
    assert (K - K).nominal == 0
    assert (K - K).blocks == ()
    assert (K / K).at({}) == pytest.approx(1)


def test_copies_are_few():
    assert (K * K).blocks[0].copies == 2
    assert (K + K).blocks[0].copies == 1
    assert (K * M + 2 * K * M).blocks[0].copies == 1
    A = [[0, 1], [-K / M, -0.4 / M]]
    plant = rp.uncertain.system(A, [0, 1 / M], [1, 0])
    assert {b.element.name: b.copies for b in plant.blocks} == {"k": 1, "m": 1}


def test_copies_do_not_depend_on_units():
    big, small = rp.uncertain.real("b", 1e9, percent=5), rp.uncertain.real("s", 1e-9, percent=5)
    A = [[0, 1], [-big / small, -1e3 / small]]
    plant = rp.uncertain.system(A, [0, 1 / small], [1, 0])
    assert [b.copies for b in plant.blocks] == [1, 1]
    at = plant.at({"b": 1.02e9, "s": 0.97e-9})
    assert at.A[1, 0] == pytest.approx(-1.02e9 / 0.97e-9)


def test_skewed_range_meets_its_ends():
    for value in (1, 2, 5, 3.3):
        assert M.at({"m": value}) == pytest.approx(value)
    assert M.elements["m"].delta(5) == pytest.approx(1)
    assert M.elements["m"].delta(1) == pytest.approx(-1)


def test_samples():
    c = rp.uncertain.complex("c", 1, radius=0.3)
    d = rp.uncertain.dynamics("d", (2, 3), bound=0.5)
    numbers = K.sample(50, seed=3)
    assert min(numbers) >= 6
    assert max(numbers) <= 14
    assert numbers == K.sample(50, seed=3) != K.sample(50, seed=4)
    for machine in d.sample(5):
        assert machine.noutputs == 2
        assert rp.hinf_norm(machine).value <= 0.5 + 1e-9
    for one in c.sample(3):
        assert rp.hinf_norm(one - 1).value <= 0.3 + 1e-9


def test_dynamics_take_systems():
    d = rp.uncertain.dynamics("d", bound=rp.weight(0.1, 10, 2))
    lag = control.ss([[-1.0]], [[1.0]], [[0.5]], 0)
    closed = (1 + d).at({"d": lag})
    want = 1 + rp.weight(0.1, 10, 2)(3j) * lag(3j)
    assert complex(closed(3j)) == pytest.approx(complex(np.squeeze(want)))


def test_lft_and_connections():
    P = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert rp.uncertain.lft(P, K).at({"k": 7}) == pytest.approx(1 + 2 * 7 * 3 / (1 - 4 * 7))
    assert rp.feedback(2.0, K).at({"k": 7}) == pytest.approx(2 / 15)
    assert rp.feedback(K, 2.0, sign=1).at({"k": 7}) == pytest.approx(7 / (1 - 14))
    both = rp.uncertain.append(K, [[1.0, 2.0]])
    assert both.shape == (2, 3)


def test_interconnection_is_the_same_system():
    plant = rp.uncertain.system([[-K]], [[1]], [[1]])
    inside = plant.interconnection
    delta = plant.elements["k"].delta(12)
    assert delta == 0.5
    A = inside.A + inside.B[:, :1] @ inside.C[:1] * delta
    assert A[0, 0] == pytest.approx(plant.at({"k": 12}).A[0, 0])


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: K.at({"q": 1}), "names among k"),
        (lambda: K.at(3), "mapping"),
        (lambda: K.at({"k": "x"}), "number"),
        (lambda: K**0.5, "whole number"),
        (lambda: K + "a", "operand"),
        (lambda: K * None, "operand"),
        (lambda: K + 1j, "uncertain_complex"),
        (lambda: K.sample(0), "at least 1"),
        (lambda: 1 / (K - 10), "invertible"),
        (lambda: K.feedback(-0.1), "well posed"),
        (lambda: K.feedback([[1, 2]]), "1 x 1"),
        (lambda: K.feedback(1, sign=0), "sign"),
        (lambda: K + rp.uncertain.real("k", 11, percent=40), "one meaning"),
        (lambda: np.eye(2) * K * np.eye(3), "sizes that fit"),
        (lambda: K[0], "rows and columns"),
        (lambda: K[0, 3], "positions below 1"),
        (lambda: M.at({"m": -1e9}), "same side"),
    ],
)
def test_bad_input(call, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        call()


def test_signals_are_picked_by_name_and_by_position():
    k = rp.uncertain.real("k", 10, percent=40)
    system = rp.uncertain.system(
        [[0, 1], [-k, -2]], np.eye(2), np.eye(2), inputs=["F", "push"], outputs=["x", "v"]
    )
    picked = system[["v", 0], "push"]
    assert (picked.output_labels, picked.input_labels) == (["v", "x"], ["push"])
    same = system[[1, 0], [1]]
    np.testing.assert_array_equal(picked.at({"k": 12}).B, same.at({"k": 12}).B)
    np.testing.assert_array_equal(picked.at({"k": 12}).C, same.at({"k": 12}).C)
    assert system[:, "F"].shape == (2, 1)
    with pytest.raises(rp.InvalidInputError, match="names among F, push"):
        _ = system["x", "force"]


K = rp.uncertain.real("k", 10, percent=40)


def test_names():
    plant = rp.uncertain.system(
        [[0, 1], [-K, -1]], [[0], [1]], [[1, 0]], states=["x", "v"], inputs=["F"], outputs=["y"]
    )
    machine = plant.at({"k": 11})
    assert machine.state_labels == ["x", "v"]
    assert machine.input_labels == ["F"]
    assert plant.feedback().nominal.output_labels == ["y"]


def test_sampling_time():
    discrete = rp.uncertain.system([[0.05 * K]], [[1]], [[1]], 0, dt=0.1)
    assert discrete.nominal.dt == 0.1
    with pytest.raises(rp.InvalidInputError, match="sampling time"):
        discrete * rp.uncertain.system([[-K]], [[1]], [[1]])


@pytest.mark.parametrize(
    ("matrices", "says"),
    [
        (([[0, 1]], [[1]], [[1]]), "A: got shape"),
        (([[K]], [[1], [2]], [[1]]), "B: got shape"),
        (([[K]], [[1]], [[1]], [[1, 2]]), "D: got shape"),
        (([["a"]], [[1]], [[1]]), "A"),
        (([[rp.uncertain.dynamics("d")]], [[1]], [[1]]), "dynamic"),
        (([[K, 1], [2]], [[1]], [[1]]), "A"),
    ],
)
def test_bad_matrices(matrices, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.uncertain.system(*matrices)


def test_ways_to_tell_a_range():
    for given in ({"percent": 40}, {"plus_minus": 4}, {"range": (6, 14)}, {"percent": (-40, 40)}):
        element = rp.uncertain.real("k", 10, **given).elements["k"]
        assert (element.low, element.nominal, element.high) == pytest.approx((6, 10, 14))
    assert rp.uncertain.real("k", -10, percent=40).elements["k"].low == -14


def test_shapes_of_dynamics():
    assert rp.uncertain.dynamics("d").shape == (1, 1)
    assert rp.uncertain.dynamics("d", 2).shape == (2, 2)
    assert rp.uncertain.dynamics("d", (2, 3), bound=control.tf(1, [1, 1])).shape == (2, 3)
    one, two = rp.uncertain.dynamics((1, 1)), rp.uncertain.dynamics((1, 1), bound=0.3)
    assert len((one + two).blocks) == 2
    sampled = control.tf(1, [1, -0.5], 0.1)
    assert (rp.uncertain.dynamics("d", bound=sampled) * sampled).dt == 0.1


@pytest.mark.parametrize(
    "call",
    [
        lambda: rp.uncertain.real("k", 10),
        lambda: rp.uncertain.real("k", 10, percent=40, range=(6, 14)),
        lambda: rp.uncertain.real("k", 10, range=(11, 14)),
        lambda: rp.uncertain.real("k", 10, range=(14, 6)),
        lambda: rp.uncertain.real("k", 10, range=3),
        lambda: rp.uncertain.real("k", 0, percent=10),
        lambda: rp.uncertain.real("k", 10, percent=-5),
        lambda: rp.uncertain.real("", 10, percent=5),
        lambda: rp.uncertain.real(3, 10, percent=5),
        lambda: rp.uncertain.real("k", "ten", percent=5),
        lambda: rp.uncertain.real("k", float("nan"), percent=5),
        lambda: rp.uncertain.complex("c", 1j),
        lambda: rp.uncertain.complex("c", 1, radius=0),
        lambda: rp.uncertain.dynamics("d", (0, 1)),
        lambda: rp.uncertain.dynamics("d", (1, 2, 3)),
        lambda: rp.uncertain.dynamics("d", (1, 1), bound=-1),
        lambda: rp.uncertain.dynamics("d", (2, 2), bound=control.tf([1, 0], 1)),
        lambda: rp.uncertain.dynamics("d", (2, 2), bound=[[1, 2, 3]]),
    ],
)
def test_bad_ranges_and_shapes(call):
    with pytest.raises(rp.InvalidInputError):
        call()


def test_dynamics_of_several_signals():
    d = rp.uncertain.dynamics("d", (1, 2))
    value = control.ss([[-1.0]], [[1.0, 2.0]], [[0.2]], 0)
    both = rp.uncertain.append(d, d).at({"d": value})
    assert both.nstates == 2
    np.testing.assert_allclose(both(1j)[0, :2], value(1j)[0])


def test_complex_values():
    c = rp.uncertain.complex("c", 1.0, radius=0.5)
    assert c.at({"c": 1.2}) == pytest.approx(1.2)
    with pytest.raises(rp.InvalidInputError, match="no real system"):
        c.at({"c": 1 + 0.1j})


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


def test_a_number_of_an_unsymmetric_range_is_infinite_at_the_pole_of_its_map():
    """1 from 0.5 to 2 is 1 + (2/3) d / (1 - d / 3)."""
    number = rp.uncertain.real("c", 1, range=(0.5, 2)).elements["c"]
    assert [number.value(d) for d in (-1.0, 0.0, 1.0)] == pytest.approx([0.5, 1.0, 2.0])
    assert number.value(3.0) == np.inf


def test_units_do_not_make_a_loop_ill_posed():
    k = rp.uncertain.real("k", 1.0, percent=10)
    plant = rp.uncertain.system([[-k]], [[1e-9]], [[1.0]])
    loop = plant.feedback(1e9)
    np.testing.assert_allclose(loop.nominal.poles(), [-2.0], rtol=1e-9)
