"""Gradients of the searches over gains against differences: designs may be good without them."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from robustpolish.synthesis.nonsmooth.descent import MaskedGain, ObserverGain, PositiveElements
from robustpolish.synthesis.nonsmooth.measures import (
    FrobeniusMeasure,
    GainMeasure,
    H2Measure,
    HinfMeasure,
    RegionMeasure,
    StabilityMeasure,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented, controller_loop

RNG = np.random.default_rng(7)


def random_loop(discrete=False, d22=0.3, n=4):
    """Stable, with two w, u and y and three z; with feedthroughs in discrete time."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(n, n))
    poles = np.linalg.eigvals(A)
    A = 0.7 * A / np.abs(poles).max() if discrete else A - (poles.real.max() + 0.5) * np.eye(n)
    shapes = (n, 2), (n, 2), (3, n), (2, n), (3, 2), (3, 2), (2, 2), (2, 2)
    sizes = (1, 1, 1, 1, discrete, 1, discrete, d22)
    drawn = [size * rng.normal(size=shape) for size, shape in zip(sizes, shapes, strict=True)]
    return PlantMatrices(A, *drawn, discrete)


def random_gain(order, discrete):
    """A gain, small enough to leave a random loop stable, around a controller's own states."""
    K = 0.02 * RNG.normal(size=(2 + order, 2 + order))
    if order and not discrete:
        K[:order, :order] -= np.eye(order)
    return K


def assert_gradient(measure, K):
    def value(k):
        return measure.pieces(k.reshape(K.shape), 0.0, ())[0].value

    found = measure.pieces(K, 0.0, ())[0].gradient
    expected = approx_fprime(K.ravel(), value, 1e-7).reshape(K.shape)
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("make", [HinfMeasure, H2Measure, StabilityMeasure.of])
@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("d22", [0.0, 0.3])
@pytest.mark.parametrize("order", [0, 1])
def test_gradients_of_norms_and_poles(make, discrete, d22, order):
    loop = augmented(random_loop(discrete, d22), order)
    assert_gradient(make(loop), random_gain(order, discrete))


@pytest.mark.parametrize(
    ("measure", "K"),
    [
        (HinfMeasure(controller_loop(1, np.eye(2), np.eye(2), False)), random_gain(1, False)),
        (
            RegionMeasure(random_loop(), lambda p: (abs(p + 1), (p + 1) / abs(p + 1))),
            random_gain(0, False),
        ),
        (GainMeasure(np.diag([1e3, 2.0, 0.1]), RNG.normal(size=(2, 4))), RNG.normal(size=(3, 2))),
        (FrobeniusMeasure(), RNG.normal(size=(3, 2))),
    ],
)
def test_gradients_of_controllers_regions_and_sizes(measure, K):
    assert_gradient(measure, K)


MASK = np.array([[True, False, True], [True, True, False]])


@pytest.mark.parametrize(
    "free",
    [
        ObserverGain(*(getattr(random_loop(), name) for name in ("A", "B2", "C2", "D22"))),
        MaskedGain(MASK),
        # k11 + 5 k12 + 2 k13 = 3
        MaskedGain(MASK).restricted(np.eye(1, 2), np.array([[1.0], [5.0], [2.0]]), np.array([[3]])),
        PositiveElements(RNG.normal(size=(4, 2, 3))),
    ],
    ids=lambda free: type(free).__name__,
)
def test_gradients_travel_back_by_the_adjoint(free):
    theta, change = RNG.normal(size=(2, free.size))
    G = RNG.normal(size=free.gain(theta).shape)
    slope = free.gain(theta + 1e-6 * change) - free.gain(theta - 1e-6 * change)
    assert (slope * G).sum() / 2e-6 == pytest.approx(free.back(theta, G) @ change, rel=1e-6)
