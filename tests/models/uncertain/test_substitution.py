import control
import numpy as np
import pytest

import robustpolish as rp


def test_dynamics_of_several_signals():
    d = rp.uncertain.dynamics("d", (1, 2))
    value = control.ss([[-1.0]], [[1.0, 2.0]], [[0.2]], 0)
    both = rp.uncertain.append(d, d).at({"d": value})
    assert both.nstates == 2
    np.testing.assert_allclose(both(1j)[0, :2], value(1j)[0])


def test_wrong_shape():
    with pytest.raises(rp.InvalidInputError, match="1 x 2"):
        rp.uncertain.dynamics("d", (1, 2)).at({"d": 1.0})


def test_complex_values():
    c = rp.uncertain.complex("c", 1.0, radius=0.5)
    assert c.at({"c": 1.2}) == pytest.approx(1.2)
    with pytest.raises(rp.InvalidInputError, match="no real system"):
        c.at({"c": 1 + 0.1j})
