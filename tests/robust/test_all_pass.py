import numpy as np
import pytest

import robustpolish as rp
from robustpolish.robust.witness import all_pass


@pytest.mark.parametrize("step", [0.0, 0.1])
@pytest.mark.parametrize("shape", [(1, 1), (3, 2), (1, 3)])
def test_value_and_norm(shape, step):
    random = np.random.default_rng(sum(shape))
    left, right = (random.standard_normal(n) + 1j * random.standard_normal(n) for n in shape)
    value = np.outer(left, right)
    system = all_pass(value, 2.0, step)
    point = np.exp(2j * step) if step else 2j
    np.testing.assert_allclose(np.atleast_2d(system(point)), value, atol=1e-12)
    assert rp.hinf_norm(system).value == pytest.approx(np.linalg.norm(value, 2), rel=1e-9)
    assert rp.linear.stability(system).verdict == "stable"


def test_real_values_need_no_lag():
    assert all_pass(np.array([[-0.3 + 0j]]), 0.0).nstates == 0
