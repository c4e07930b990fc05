"""The H2 norm: known values, light damping, the thesis's number, bad input."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing


def ss(A, B, C, D=0, dt=0):
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False)


@pytest.mark.parametrize("w", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("zeta", [1e-12, 1e-6, 0.05])
def test_an_oscillator_has_its_textbook_norm(w, zeta):
    norm = h2_norm(ss([[0, 1], [-w * w, -2 * zeta * w]], [[0], [w * w]], [[1, 0]]))
    assert norm.value == pytest.approx(np.sqrt(w / (4 * zeta)), rel=1e-9)
    assert norm.lower <= norm.value <= norm.upper <= norm.lower * (1 + 2e-9)


@pytest.mark.parametrize(
    ("system", "value"),
    [
        (ss([[-2]], [[1]], [[1]]), 0.5),
        (ss([[0.6]], [[1]], [[1]], 0, True), 1.25),
        (ss([[0.6]], [[1]], [[1]], 2, 0.1), np.sqrt(1.25**2 + 4)),
        (ss(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 2, True), 2),
        (ss([[-1, 0], [0, -1]], [[1], [1]], [[1, -1]]), 0),
        (ss([[-1, 0], [0, -4]], np.eye(2), np.eye(2)), np.sqrt(0.5 + 0.125)),
    ],
)
def test_small_systems(system, value):
    norm = h2_norm(system)
    assert norm.stable
    assert norm.value == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("system", "stable", "told"),
    [
        (ss([[-1]], [[1]], [[1]], 1e-9), True, "D is not zero"),
        (ss([[0]], [[1]], [[1]]), False, "on the imaginary axis"),
        (ss([[2]], [[1]], [[1]], 0, True), False, "outside the unit circle"),
    ],
)
def test_infinite_norms_say_why(system, stable, told):
    norm = h2_norm(system)
    assert norm.value == np.inf
    assert norm.stable is stable
    assert told in norm.reason


def test_a_hidden_pole_on_the_axis_leaves_the_norm_finite():
    norm = h2_norm(ss([[0, 0], [0, -2]], [[1], [1]], [[0, 1]]))
    assert norm.value == pytest.approx(0.5)
    assert not norm.stable


def test_the_open_loop_of_the_thesis():
    plant = air_bearing(AirBearingParameters.as_published(), dissipation=0.01)
    assert h2_norm(plant.open_loop).value == pytest.approx(0.00294744, rel=2e-6)


def test_both_gramians_agree():
    rng = np.random.default_rng(3)
    for dt in (0, 1.0):
        A = rng.standard_normal((8, 8))
        A = A / (1.001 * abs(np.linalg.eigvals(A)).max())
        A = A if dt else A - 1.0001 * np.eye(8)
        G = ss(A, rng.standard_normal((8, 2)), rng.standard_normal((3, 8)), 0, dt)
        dual = ss(G.A.T, G.C.T, G.B.T, 0, dt)
        assert h2_norm(G).value == pytest.approx(h2_norm(dual).value, rel=1e-10)


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match="system: got FrequencyResponseData"):
        h2_norm(control.frd([1, 2], [1, 2]))
    with pytest.raises(InvalidInputError, match="tolerance"):
        h2_norm(ss([[-1]], [[1]], [[1]]), tolerance=-1)
