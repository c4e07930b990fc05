"""The margin of normalised coprime factors against published and closed forms."""

import control
import numpy as np
import pytest

import robustpolish as rp


def test_numbers_of_matlabs_documentation():
    P, C = control.tf([1, 2], [1, 5, 10]), control.tf([4.4], [1, 0])
    assert rp.uncertain.ncf_margin(P, C, sign=-1) == pytest.approx(0.1961, abs=5e-5)
    slow = control.tf([4], [1, -0.001])
    assert rp.uncertain.ncf_margin(slow, 1, sign=-1) == pytest.approx(0.7069, abs=5e-5)
    assert rp.uncertain.ncf_margin(slow, control.tf([10], [1]), sign=-1) == pytest.approx(
        0.0995, abs=5e-5
    )


@pytest.mark.parametrize(("g", "k"), [(0.5, -1.0), (3.0, -0.2), (0.5, 0.9)])
def test_gains_in_closed_form(g, k):
    # |1 - g k| / sqrt((1 + g^2)(1 + k^2))
    expected = abs(1 - g * k) / np.sqrt((1 + g * g) * (1 + k * k))
    assert rp.uncertain.ncf_margin(control.tf([g], [1]), k) == pytest.approx(expected)


@pytest.mark.parametrize("sign", [1, -1])
def test_signs(sign):
    G = control.tf([2], [1, -1])
    assert (rp.uncertain.ncf_margin(G, 3.0 * sign, sign=-sign) > 0.2) == (sign * -sign < 0)
    assert rp.uncertain.ncf_margin(G, -3.0 * sign, sign=sign) == pytest.approx(
        rp.uncertain.ncf_margin(G, -3.0), rel=1e-9
    )


def test_unstable_loops_have_none():
    G = control.tf([2], [1, -1])
    assert rp.uncertain.ncf_margin(G, 0.1) == 0
    hidden = control.ss([[-1.0, 0.0], [0.0, 1.0]], [[1.0], [0.0]], [[1.0, 0.0]], 0)
    assert rp.uncertain.ncf_margin(hidden, -1.0) == 0


def test_a_grid_of_the_definition():
    np.random.seed(1)  # noqa: NPY002, which is what control.rss draws from
    G = control.rss(4, 2, 2, strictly_proper=True)
    K = control.ss(rp.loop_shaping(G).controller)
    worst = 0.0
    for w in np.geomspace(1e-3, 1e3, 3000):
        g, k = G(1j * w), K(1j * w)
        S = np.linalg.inv(np.eye(2) - g @ k)
        block = np.vstack([np.eye(2), k]) @ S @ np.hstack([np.eye(2), g])
        worst = max(worst, np.linalg.norm(block, 2))
    assert rp.uncertain.ncf_margin(G, K) == pytest.approx(1 / worst, rel=1e-4)


def test_delays_count_as_they_are():
    lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    plant = rp.GeneralizedPlant(lag, "y", "u").with_delay("u", 0.5, order=1)
    omega = np.geomspace(1e-3, 50, 20000)
    g = np.exp(-0.5j * omega) / (1 + 1j * omega)
    chord = np.abs(1 + 3 * g) / np.sqrt((1 + np.abs(g) ** 2) * 10)
    assert rp.uncertain.ncf_margin(plant, -3.0) == pytest.approx(chord.min(), rel=1e-4)
    assert rp.uncertain.ncf_margin(plant, -6.0) == 0


def test_bad_arguments_are_named():
    G = control.tf([2], [1, -1])
    with pytest.raises(rp.InvalidInputError, match="sign: got 0"):
        rp.uncertain.ncf_margin(G, 1.0, sign=0)
    with pytest.raises(rp.InvalidInputError, match="controller: got shape"):
        rp.uncertain.ncf_margin(G, np.eye(2))
    with pytest.raises(rp.InvalidInputError, match="plant: got None"):
        rp.uncertain.ncf_margin(None, 1.0)
