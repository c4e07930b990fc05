"""Random loops for the measures of norms and poles, and gradients by differences."""

import numpy as np

from robustpolish.synthesis.problem.matrices import PlantMatrices


def random_loop(rng, discrete=False, d22=0.0, n=4):
    """Stable, with two w, u and y and three z; with feedthroughs in discrete time."""
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
    """A gain, small enough to leave a random loop stable, around a controller's own states."""
    K = 0.02 * rng.normal(size=(2 + order, 2 + order))
    if order and not discrete:
        K[:order, :order] -= np.eye(order)
    return K


def scalar_loop(A=0.0, D11=0.0, D12=0.0, D21=0.0, B2=1.0, C1=1.0, discrete=False):
    """X' = A x + w + B2 u, z = C1 x + D11 w + D12 u, y = x + D21 w."""
    numbers = (A, 1.0, B2, C1, 1.0, D11, D12, D21, 0.0)
    return PlantMatrices(*(np.array([[float(number)]]) for number in numbers), discrete=discrete)


def slope_by_differences(measure, K, change, step=1e-6):
    """Return the change of a measure in one direction, by central differences."""
    up, down = (measure.pieces(K + s * step * change, 0.0, ())[0].value for s in (1, -1))
    return (up - down) / (2 * step)


def assert_gradient(measure, K, rng):
    """Compare the gradient of a measure with differences in a random direction."""
    change = rng.normal(size=K.shape)
    slope = (measure.pieces(K, 0.0, ())[0].gradient * change).sum()
    expected = slope_by_differences(measure, K, change)
    assert abs(slope - expected) <= 1e-3 * abs(expected)
