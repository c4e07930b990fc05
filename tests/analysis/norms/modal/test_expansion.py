"""Power series of the response and their errors."""

import numpy as np
import pytest

from robustpolish.analysis.norms.modal.cover import FAR
from robustpolish.analysis.norms.modal.expansion import ORDER, expand, expand_far
from robustpolish.analysis.norms.modal.modal_form import modal_form
from robustpolish.analysis.poles.eigen import eigensystem
from tests.analysis.norms.random_models import model, response


def summed(expansion, i, t):
    return sum(expansion.terms[j, i] * t**j for j in range(ORDER))


@pytest.mark.parametrize("dt", [0, 0.1])
def test_the_series_are_the_response_within_their_errors(dt):
    G = model(5, dt=dt)
    form = modal_form(G, eigensystem(G.A), True)
    poles = form.real + 1j * form.imag.astype(float)
    centre = np.array([0.0, 0.3, 1.0, 4.0])
    half = 0.3 * np.abs(1j * centre[:, None] - poles).min(axis=1)
    found = expand(form, centre, half)
    for i in range(4):
        for t in (-1.0, -0.3, 0.0, 1.0):
            away = np.linalg.norm(summed(found, i, t) - response(G, centre[i] + half[i] * t), 2)
            assert away <= found.error[i] + 1e-12
    assert found.error.max() < 0.1
    sharp = expand(form, centre, 0 * half)
    assert (sharp.error < 1e-9).all()  # nothing but rounding is left
    few = found.chosen(np.array([False, True, False, True]))
    np.testing.assert_array_equal(few.centre, [0.3, 4.0])


@pytest.mark.parametrize("dt", [0, 0.1])
def test_the_last_piece_reaches_to_infinity(dt):
    G = model(5, dt=dt)
    form = modal_form(G, eigensystem(G.A), True)
    start = FAR * float(np.hypot(form.real, form.imag.astype(float)).max())
    found = expand_far(form, start)
    for t in (1.0, 0.5, 1e-6):
        away = np.linalg.norm(summed(found, 0, t) - response(G, start / t), 2)
        assert away <= found.error[0] + 1e-12
    assert found.error[0] < 0.01


def test_a_piece_too_long_for_its_series_has_no_bound():
    G = model(5)
    form = modal_form(G, eigensystem(G.A), True)
    assert expand(form, np.array([1.0]), np.array([100.0])).error[0] == np.inf
