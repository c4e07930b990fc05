"""Any strictly proper controller of the plant's order is an observer."""

import numpy as np
import pytest
from small_plants import regular_plant

from robustpolish.synthesis.structured.observer import observer_controller, observer_form


def test_any_strictly_proper_controller_is_an_observer():
    plant = regular_plant(4, seed=2, d22=0.3)
    F, L = np.ones((1, 4)), np.ones((4, 1))
    K = observer_controller(plant, F, L)
    T = np.random.default_rng(0).normal(size=(4, 4))
    Ak, Bk, Ck = np.linalg.solve(T, K.A @ T), np.linalg.solve(T, K.B), K.C @ T
    form = observer_form(plant.A, plant.B2, plant.C2, plant.D22, Ak, Bk, Ck)
    assert form is not None
    again = observer_controller(plant, form.F, form.L)
    for s in (0.1j, 1j, 10j):
        assert again(s) == pytest.approx(K(s), rel=1e-6)
