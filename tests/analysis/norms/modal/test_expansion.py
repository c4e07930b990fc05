"""Power series of the response and their errors."""

import numpy as np
import pytest

from robustpolish.linear.eigen import eigensystem
from robustpolish.linear.norms.modal_expansion import (
    FAR,
    ORDER,
    expand,
    expand_far,
    expansion_error,
)
from robustpolish.linear.norms.modal_form import modal_arrays, modal_form
from tests.analysis.norms.random_models import model, response


def summed(terms, t):
    return sum(terms[j] * t**j for j in range(ORDER))


def modes_and_room(G):
    form = modal_form(G, eigensystem(G.A), True)
    return modal_arrays(form), np.empty((ORDER, *form.D.shape), complex)


@pytest.mark.parametrize("dt", [0, 0.1])
def test_the_series_are_the_response_within_their_errors(dt):
    G = model(5, dt=dt)
    modes, terms = modes_and_room(G)
    poles = modes.real + 1j * modes.high
    for centre in (0.0, 0.3, 1.0, 4.0):
        half = 0.3 * np.abs(1j * centre - poles).min()
        expand(modes, centre, half, terms)
        error, most = expansion_error(modes, centre, half, 0.0)
        coarse, _ = expansion_error(modes, centre, half, 1.0)
        assert error <= coarse * (1 + 1e-12) <= error + 1e-11
        for t in (-1.0, -0.3, 0.0, 1.0):
            away = np.linalg.norm(summed(terms, t) - response(G, centre + half * t), 2)
            assert away <= error + 1e-12
            assert np.linalg.norm(response(G, centre + half * t), 2) <= most
        assert error < 0.1
        assert expansion_error(modes, centre, 0.0, 0.0)[0] < 1e-9  # nothing but rounding is left


@pytest.mark.parametrize("dt", [0, 0.1])
def test_the_last_piece_reaches_to_infinity(dt):
    G = model(5, dt=dt)
    modes, terms = modes_and_room(G)
    start = FAR * float(np.hypot(modes.real, modes.high).max())
    error = expand_far(modes, start, terms)
    for t in (1.0, 0.5, 1e-6):
        away = np.linalg.norm(summed(terms, t) - response(G, start / t), 2)
        assert away <= error + 1e-12
    assert error < 0.01


def test_a_piece_too_long_for_its_series_has_no_bound():
    modes, _ = modes_and_room(model(5))
    assert expansion_error(modes, 1.0, 100.0, 0.0) == (np.inf, np.inf)
