"""The thesis's way of loading a linear system, and tables 11.1 to 11.8."""

import numpy as np
import pytest
from scipy.linalg import expm

from robustpolish.brush import ListingDefects, listing_response, simulate_brush
from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.models import air_bearing
from robustpolish.synthesis import published_gain


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


# Largest deviations in y and z [m]: tables 11.1, 11.3, 11.5 and 11.7.
TABLES = {
    1: {
        "original": (0.0177, 1.9855e-4),
        "first": (7.5486e-4, 7.1232e-6),
        "first_scaled": (4.5467e-4, 8.0705e-6),
        "second": (7.4643e-5, 2.4510e-5),
        "second_scaled": (6.8915e-4, 9.7659e-6),
    },
    4: {
        "original": (0.0094, 1.5049e-4),
        "first": (7.9841e-4, 1.2877e-5),
        "first_scaled": (4.9490e-4, 1.2861e-5),
        "second": (8.2640e-5, 4.6829e-5),
        "second_scaled": (8.0809e-4, 1.9925e-5),
    },
}
WORKAROUND = {1: "divide", 4: "impulse"}
# Outputs are the total displacements q_m + q (section 8.1.1).
TOTAL = np.kron(np.eye(3), [[1.0, 0.0, 1.0, 0.0]])


def _loop(row: str):
    """A, B1 and, for the loop without controller, the bearing's mass."""
    if row == "original":
        # D.2 loads the right axes, but damps the 194 Hz mode with c_A instead of c_D.
        plant, c_A, m_t = air_bearing(), 1.31593, 0.2
        loop = np.array(plant.A)
        for speed in (3, 7):
            loop[speed, speed], loop[speed, speed - 2] = -c_A / m_t, c_A / m_t
        return loop, plant.B1, 1.337
    actuation = "displacement" if row.startswith("first") else "force"
    plant = air_bearing(actuation=actuation, load="printed")
    return plant.A + plant.B2 @ published_gain(row), plant.B1, None


@pytest.mark.slow
@pytest.mark.parametrize("run", TABLES)
def test_tables_of_chapter_11(run: int) -> None:
    """Total displacements in y and z, largest over 5 s.

    The listing is chaotic once its contacts chatter: rounding decides which forces come when, and
    a largest value may rest on a single one of them. Of nine realisations of run 4, eight give
    0.79 to 0.84 times the y printed for C.5, and one, by a spike at 4.135 s, 1.005 times.
    So one value of a run may be out by more than 12 %; the other nine may not.
    """
    brush = simulate_brush("listing", run=run, workaround=WORKAROUND[run])
    ratios = []
    for row, printed in TABLES[run].items():
        loop, B1, bearing_mass = _loop(row)
        answer = listing_response(loop, B1, TOTAL, brush, bearing_mass=bearing_mass)
        ratios.append(answer.largest[1:] / printed)
        if row == "original":
            assert 5e-4 < float(answer.largest[0]) < 2e-3  # scatters with the solver
        else:
            assert float(answer.largest[0]) == 0.0  # the gate on w(2): "100 %" in the tables
    error = np.sort(np.abs(np.concatenate(ratios) - 1.0))
    assert error[-2] < 0.12
    assert error[-1] < 0.30
