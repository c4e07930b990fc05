import numpy as np
import pytest

from robustpolish.robust.loop_model import equilibrate


@pytest.mark.parametrize("seed", range(3))
def test_rows_and_columns_are_alike_whatever_the_units_were(seed):
    random = np.random.default_rng(seed)
    sizes = np.abs(random.standard_normal((6, 6)))
    units = 10.0 ** random.uniform(-4, 4, 6)
    found = []
    for one in (sizes, sizes * units / units[:, None]):
        scales = equilibrate(one)
        assert np.exp(np.log(scales).mean()) == pytest.approx(1)
        found.append(one * scales / scales[:, None])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-10)
    off = found[0] - np.diag(np.diag(found[0]))
    np.testing.assert_allclose(np.linalg.norm(off, axis=0), np.linalg.norm(off, axis=1), rtol=1e-10)


def test_what_acts_one_way_only_ends_somewhere():
    sizes = np.array([[0.0, 1e3, 0.0], [0.0, 0.0, 2.0], [0.0, 3.0, 0.0]])
    scales = equilibrate(sizes)
    turned = sizes * scales / scales[:, None]
    assert np.isfinite(scales).all()
    assert 0 < turned[0, 1] < 1e-3
    assert turned[1, 2] == pytest.approx(turned[2, 1], rel=1e-3)


def test_nothing_to_even():
    np.testing.assert_array_equal(equilibrate(np.diag([1.0, 2.0])), np.ones(2))
