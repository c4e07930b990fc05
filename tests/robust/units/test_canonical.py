import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import magnitude, midpoint
from robustpolish.robust.loop_model import canonical

RANDOM = np.random.default_rng(4)
A, B, C, D = (RANDOM.standard_normal(shape) for shape in ((3, 3), (3, 3), (2, 3), (2, 3)))
A = A - (np.linalg.eigvals(A).real.max() + 0.2) * np.eye(3)
# one number, and a block of two rows and one column
W, Z = [0, 1, 1], [0, 1]


def response(matrices, s):
    a, b, c, d = matrices
    return d + c @ np.linalg.solve(s * np.eye(len(a)) - a, b)


@pytest.mark.parametrize("discrete", [False, True])
def test_response_is_that_of_the_model_in_other_units(discrete):
    given = (A / 20, B, C, D) if discrete else (A, B, C, D)
    found = canonical(given, discrete, W, Z)
    model, x = found.model, 0.7j
    s = x * found.time
    there = response(given, (1 + s) / (1 - s) if discrete else s)
    here = found.gain * response((model.A, model.B, model.C, model.D), x)
    ratios = there / here
    # a number has one unit, and the other block one for all its signals
    assert ratios[0, 0] == pytest.approx(1)
    assert ratios[1, 1:] == pytest.approx([1, 1])
    assert ratios[0, 1] == pytest.approx(ratios[0, 2])
    assert ratios[0, 1] * ratios[1, 0] == pytest.approx(1)


def test_balls_hold_what_doubles_round():
    found = canonical((A, B, C, D), False, W, Z)
    model = found.model
    for ball, rounded in zip(found.balls, (model.A, model.B, model.C, model.D), strict=True):
        np.testing.assert_array_equal(midpoint(ball), rounded)
        assert magnitude(ball - ball.mid()).max() < 1e-80
