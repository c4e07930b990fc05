"""Values against independent computations, gradients against differences."""

import control
import numpy as np
import pytest

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.synthesis.nonsmooth import (
    FrobeniusMeasure,
    GainMeasure,
    H2Measure,
    HinfMeasure,
    ObserverGain,
    RegionMeasure,
    StabilityMeasure,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import augmented, close_static, controller_loop


def random_loop(rng, discrete=False, d22=0.0, n=4):
    A = rng.normal(size=(n, n))
    if discrete:
        A *= 0.7 / np.abs(np.linalg.eigvals(A)).max()
    else:
        A -= (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(n)
    feed = 1.0 if discrete else 0.0
    draw = lambda *shape: rng.normal(size=shape)  # noqa: E731
    return PlantMatrices(
        A,
        draw(n, 2),
        draw(n, 2),
        draw(3, n),
        draw(2, n),
        feed * draw(3, 2),
        draw(3, 2),
        feed * draw(2, 2),
        d22 * draw(2, 2),
        discrete,
    )


def random_gain(rng, order, discrete):
    K = 0.02 * rng.normal(size=(2 + order, 2 + order))
    if order and not discrete:
        K[:order, :order] -= np.eye(order)
    return K


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("d22", [0.0, 0.3])
@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("kind", ["hinf", "h2", "abscissa", "gain", "size"])
def test_gradient_agrees_with_differences(discrete, d22, order, kind):
    rng = np.random.default_rng(7)
    loop = augmented(random_loop(rng, discrete, d22), order)
    measure = {
        "hinf": HinfMeasure(loop),
        "h2": H2Measure(loop),
        "abscissa": StabilityMeasure.of(loop),
        "gain": GainMeasure(np.eye(2 + order), np.eye(2 + order)),
        "size": FrobeniusMeasure(),
    }[kind]
    K = random_gain(rng, order, discrete)
    change = rng.normal(size=K.shape)
    step = 1e-6
    up, down = (measure.pieces(K + s * step * change, 0.0, ())[0].value for s in (1, -1))
    piece = measure.pieces(K, 0.0, ())[0]
    assert (piece.gradient * change).sum() == pytest.approx((up - down) / (2 * step), rel=1e-3)


def test_gradient_of_a_region_and_of_the_controllers_own_norm():
    rng = np.random.default_rng(1)
    loop = random_loop(rng)
    disk = RegionMeasure(loop, lambda p: (abs(p + 1), (p + 1) / abs(p + 1)))
    own = HinfMeasure(controller_loop(1, np.eye(2), np.eye(2), False))
    for measure, K in ((disk, random_gain(rng, 0, False)), (own, random_gain(rng, 1, False))):
        change = rng.normal(size=K.shape)
        up, down = (measure.pieces(K + s * 1e-6 * change, 0.0, ())[0].value for s in (1, -1))
        slope = (measure.pieces(K, 0.0, ())[0].gradient * change).sum()
        assert slope == pytest.approx((up - down) / 2e-6, rel=1e-3)


@pytest.mark.parametrize("discrete", [False, True])
def test_norms_agree_with_the_analysis_room(discrete):
    rng = np.random.default_rng(3)
    for n in (1, 3, 6, 10):
        loop = random_loop(rng, discrete, n=n)
        # Lightly damped, so that peaks are narrow and many.
        closed = close_static(loop, np.zeros((2, 2)))
        system = control.ss(closed.A, closed.B, closed.C, closed.D, discrete)
        found = HinfMeasure(loop).pieces(np.zeros((2, 2)), 0.0, ())[0].value
        assert found == pytest.approx(float(hinf_norm(system)), rel=1e-6)
        found = H2Measure(loop).pieces(np.zeros((2, 2)), 0.0, ())[0].value
        assert found == pytest.approx(float(h2_norm(system)), rel=1e-6)


def test_all_peaks_within_the_width_are_found():
    w = np.array([1.0, 3.0, 9.0])
    A = np.zeros((6, 6))
    B, C = np.zeros((6, 1)), np.zeros((1, 6))
    for i, (omega, height) in enumerate(zip(w, (1.0, 0.99, 0.5), strict=True)):
        zeta = 1e-3
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-(omega**2), -2 * zeta * omega]]
        B[2 * i + 1], C[0, 2 * i] = 1.0, height * 2 * zeta * omega**2
    one = np.zeros((1, 1))
    loop = PlantMatrices(A, B, B, C, C, one, one, one, one)
    pieces = HinfMeasure(loop).pieces(np.zeros((1, 1)), 0.05, ())
    peaks = sorted(p.frequency for p in pieces)
    assert peaks == pytest.approx([1.0, 3.0], rel=1e-2)


def test_unstable_loops_have_no_norm():
    one, zero = np.eye(1), np.zeros((1, 1))
    loop = PlantMatrices(one, one, one, one, one, zero, zero, zero, zero)
    assert HinfMeasure(loop).pieces(zero, 0.0, ()) == []
    assert H2Measure(loop).pieces(zero, 0.0, ()) == []


def test_observer_gain_and_its_adjoint():
    rng = np.random.default_rng(5)
    loop = random_loop(rng, d22=0.2)
    observer = ObserverGain(loop.A, loop.B2, loop.C2, loop.D22)
    theta, change = rng.normal(size=(2, observer.size))
    G = rng.normal(size=observer.gain(theta).shape)
    slope = observer.gain(theta + 1e-6 * change) - observer.gain(theta - 1e-6 * change)
    assert (slope * G).sum() / 2e-6 == pytest.approx(observer.back(theta, G) @ change, rel=1e-6)
