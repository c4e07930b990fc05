"""The thesis's way of loading a linear system, and tables 11.1 to 11.8."""

import numpy as np
import pytest
from scipy.linalg import expm

from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.thesis.listing import ListingDefects, listing_response


@pytest.fixture(scope="module")
def brush():
    return simulate_brush("listing", run=4, duration=0.05, workaround="impulse")


def _oscillators(load: int) -> tuple[np.ndarray, np.ndarray]:
    """Six damped oscillators of 20 Hz, the last driven by one of the four loads."""
    A = np.kron(np.eye(6), [[0.0, 1.0], [-1.6e4, -20.0]])
    B1 = np.zeros((12, 4))
    B1[11, load] = 1.0
    return A, B1


def test_constant_load_gives_the_exact_response(brush) -> None:
    """F_p is constant, whatever the brush does."""
    A, B1 = _oscillators(3)
    answer = listing_response(A, B1, np.eye(12)[[10]], brush, tolerance=1e-8)
    steady = -np.linalg.solve(A, B1[:, 3] * 10.0)
    for sample in (200, 1000):
        expected = steady - expm(A * float(answer.time[sample])) @ steady
        assert float(answer.response[sample, 0]) == pytest.approx(expected[10], rel=1e-4)
    assert float(answer.largest[0]) >= float(abs(answer.response).max())


def test_without_mistakes_the_load_is_that_of_the_dataset(brush) -> None:
    A, B1 = _oscillators(2)
    mended = simulate_brush(
        "listing", run=4, duration=0.05, workaround="impulse", defects=ListingDefects.none()
    )
    answer = listing_response(A, B1, np.eye(12)[[10]], mended)
    time, force = mended.time.values, mended.F_z.values
    kernel = np.array([(expm(A[10:, 10:] * t))[0, 1] for t in time[-1] - time[::50]])
    expected = np.trapezoid(kernel * force[::50], time[::50])
    assert float(answer.response[-1, 0]) == pytest.approx(expected, rel=0.05)


def test_interpolation_mistake_and_gate_change_the_load(brush) -> None:
    A, B1 = _oscillators(1)
    C = np.eye(12)[[10]]
    gated = listing_response(A, B1, C, brush)
    assert float(gated.largest[0]) == 0.0  # nothing moves the bearing, w(2), so F_y stays off
    everything_else = tuple(n for n in ListingDefects().names() if n != "bearing_gate")
    text = " ".join(everything_else)
    opened = listing_response(A, B1, C, brush.assign_attrs(defects=text))
    assert float(opened.largest[0]) > 0.0
    meant = text.replace("interpolation_weight ", "")
    right = listing_response(A, B1, C, brush.assign_attrs(defects=meant))
    assert float(opened.largest[0]) > 100.0 * float(right.largest[0])


def test_bearing_that_is_up_drops_the_polishing_force(brush) -> None:
    A, B1 = _oscillators(2)
    kept = listing_response(A, B1, np.eye(12)[[10]], brush)
    dropped = listing_response(A, B1, np.eye(12)[[10]], brush, bearing_mass=1.337)
    assert float(dropped.largest[0]) < float(kept.largest[0])


def test_bad_input_is_named(brush) -> None:
    A, B1 = _oscillators(0)
    with pytest.raises(InvalidInputError, match="A"):
        listing_response(A[:4, :4], B1, np.eye(12), brush)
    with pytest.raises(InvalidInputError, match="B1"):
        listing_response(A, B1.T, np.eye(12), brush)
    with pytest.raises(InvalidInputError, match="brush"):
        listing_response(A, B1, np.eye(12), simulate_brush(duration=0.001))
    with pytest.raises(SolverError, match="stable"):
        listing_response(A + 1e6 * np.eye(12), B1 + 1.0, np.eye(12), brush)
