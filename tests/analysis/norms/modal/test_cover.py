"""Pieces of the axis."""

import control
import numpy as np
import pytest

from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.eigen import eigensystem
from robustpolish.linear.norms.modal_expansion import FAR, first_pieces, overlapping
from robustpolish.linear.norms.modal_form import modal_form


@pytest.mark.parametrize("damping", [0.5, 1e-3, 1e-8])
def test_pieces_cover_the_axis_and_are_short_beside_poles(damping):
    blocks = [[[0, 1], [-w * w, -2 * damping * w]] for w in (1.0, 1.1, 40.0)]
    A = np.zeros((7, 7))
    for k, block in enumerate(blocks):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    A[6, 6] = -3.0
    G = realisation("system", control.ss(A, np.ones((7, 1)), np.ones((1, 7)), 0))
    form = modal_form(G, eigensystem(G.A), True)
    by_height = np.argsort(form.imag)
    imag = form.imag[by_height].astype(float)
    centre, half, count = first_pieces(form.real[by_height], imag)
    centre, half = centre[:count], half[:count]
    order = np.argsort(centre)
    left, right = (centre - half)[order], (centre + half)[order]
    assert left[0] < 0 < right[0]
    assert (left[1:] <= np.maximum.accumulate(right)[:-1]).all()
    poles = form.real + 1j * form.imag.astype(float)
    assert right.max() >= FAR * np.abs(poles).max()
    nearest = np.abs(1j * centre[:, None] - poles).min(axis=1)
    assert np.median(half / nearest) < 0.47  # what is longer is cut later
    assert centre.size < 40 + 12 * np.log(1 / damping)


def test_rounded_pieces_still_reach_their_ends():
    rng = np.random.default_rng(0)
    left = rng.uniform(1, 2, 1000)
    right = left * (1 + 10.0 ** rng.uniform(-15, 0, 1000))
    pieces = [overlapping(*ends) for ends in zip(left, right, strict=True)]
    centre, half = np.array(pieces).T
    wide = np.longdouble
    assert (centre.astype(wide) - half.astype(wide) <= left).all()
    assert (centre.astype(wide) + half.astype(wide) >= right).all()
