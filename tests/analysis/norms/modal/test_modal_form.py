"""Modal coordinates and the bounds of what they leave out."""

import control
import flint
import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import precision
from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.eigen import eigensystem
from robustpolish.linear.norms.modal_form import modal_form
from tests.analysis.norms.random_models import model, response


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize(("inputs", "outputs"), [(2, 3), (3, 2)])
@pytest.mark.parametrize("proven", [True, False])
def test_the_residues_give_the_response(dt, inputs, outputs, proven):
    G = model(1, inputs=inputs, outputs=outputs, dt=dt)
    form = modal_form(G, eigensystem(G.A), proven)
    assert form.stable
    assert form.states == 6
    for x in (0.0, 0.7, 5.0):
        poles = form.real + 1j * form.imag.astype(float)
        found = form.D + ((1 / (1j * x - poles)) @ form.residues).reshape(form.D.shape)
        expected = response(G, x)
        np.testing.assert_allclose(
            found, expected if inputs < outputs else expected.T, rtol=1e-11, atol=1e-11
        )


def test_the_true_poles_lie_within_the_bounds():
    """Against eigenvalues in balls, of an eigensystem that is spoilt on purpose."""
    G = model(2)
    spectrum = eigensystem(G.A)
    rough = np.random.default_rng(0).standard_normal(spectrum.right.shape) * 1e-7
    spoilt = type(spectrum)(
        spectrum.values * (1 + 1e-9),
        spectrum.errors,
        spectrum.right * (1 + rough),
        spectrum.left,
    )
    for each, size in ((spectrum, 1e-12), (spoilt, 1e-4)):
        form = modal_form(G, each, True)
        with precision(200):
            exact = flint.acb_mat(flint.arb_mat(6, 6, G.A.ravel().tolist())).eig()
        poles = form.real + 1j * form.imag.astype(float)
        away = np.abs(np.array([complex(value) for value in exact])[:, None] - poles)
        assert (away.min(axis=0) <= form.rows + 1e-15).all()
        assert form.rows.max() < size
    assert form.rows.max() > 1e-9


def test_nearly_double_poles_have_no_modal_form():
    G = realisation("system", control.ss([[-1, 1], [0, -1]], [[0], [1]], [[1, 0]], 0))
    assert modal_form(G, eigensystem(G.A), True) is None


def test_multiple_poles_with_vectors_enough_have_one():
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    A = turn @ np.diag([-1.0, -1.0, -1.0, -2.0]) @ turn.T
    G = realisation("system", control.ss(A, np.ones((4, 1)), np.ones((1, 4)), 0))
    form = modal_form(G, eigensystem(G.A), True)
    assert form is not None
    assert form.rows.max() < 1e-13


def test_poles_beyond_the_boundary_are_not_called_stable():
    G = realisation("system", control.ss(np.diag([-1.0, 1e-3]), np.ones((2, 1)), [[1, 1]], 0))
    assert not modal_form(G, eigensystem(G.A), True).stable
