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


def test_partial_values():
    rest = (K * M).at({"m": 3})
    assert list(rest.elements) == ["k"]
    assert rest.at({"k": 7}) == pytest.approx(21)


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
        (lambda: K.sample(0), "above 0"),
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
