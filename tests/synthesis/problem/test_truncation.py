"""What is left out of a plant changes its response by no more than the Hankel bound."""

import control
import numpy as np
import pytest
from hard_plants import flexible_structure, heat_rod, mass_chain

from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import SolverPlant, truncated


def matrices(plant):
    return SolverPlant.of(plant, mapped=True).matrices


def response(plant, omega):
    B, C = np.hstack([plant.B1, plant.B2]), np.vstack([plant.C1, plant.C2])
    return C @ np.linalg.solve(1j * omega * np.eye(plant.nx) - plant.A, B)


@pytest.mark.parametrize("points", [90, 130])
def test_the_response_is_within_the_bound(points):
    whole = matrices(heat_rod(points))
    short, error = truncated(whole)
    assert short.nx <= whole.nx / 2
    apart = [
        np.linalg.norm(response(whole, w) - response(short, w), 2) for w in np.logspace(-6, 3, 91)
    ]
    size = max(np.linalg.norm(response(whole, w), 2) for w in np.logspace(-6, 3, 91))
    # The bound is that of exact numbers; those of doubles add their rounding.
    assert max(apart) <= error + 1e-10 * size
    assert error <= 1e-6 * size


def test_unstable_poles_stay():
    whole = matrices(heat_rod(90))
    short, _ = truncated(whole)
    unstable = [np.linalg.eigvals(P.A).real.max() for P in (whole, short)]
    assert unstable[0] > 0
    assert unstable[1] == pytest.approx(unstable[0], rel=1e-9)


@pytest.mark.parametrize("plant", [flexible_structure(20), mass_chain(20)])
def test_nothing_is_left_out_where_all_states_count(plant):
    assert truncated(matrices(plant)) is None


@pytest.mark.parametrize("size", [1.0, 1e200, 1e-200])
def test_what_doubles_cannot_tell_is_kept(size):
    """Nothing stable; and Gramians beyond doubles."""
    n = 12
    plant = GeneralizedPlant.from_matrices(
        np.zeros((n, n)) if size == 1.0 else -np.diag(np.linspace(1, 2, n)),
        size * np.ones((n, 1)),
        size * np.ones((n, 1)),
        size * np.ones((1, n)),
        size * np.ones((1, n)),
    )
    assert truncated(PlantMatrices.of(plant)) is None


def test_poles_on_the_axis_stay_as_they_are():
    """Two integrators beside a rod: rounding puts their poles on both sides of the axis."""
    rod = heat_rod(90).system
    integrators = control.ss([[0, 1], [0, 0]], np.ones((2, 2)), np.ones((2, 2)), 0)
    A = np.block([[rod.A, np.zeros((90, 2))], [np.zeros((2, 90)), integrators.A]])
    B, C = np.vstack([rod.B, integrators.B]), np.hstack([rod.C, np.ones((rod.noutputs, 2))])
    plant = GeneralizedPlant.from_matrices(A, B[:, :1], B[:, 1:], C[:-1], C[-1:])
    short, _ = truncated(matrices(plant))
    slow = np.sort(np.abs(np.linalg.eigvals(short.A)))
    assert slow[1] < 1e-6 * slow[-1]
    assert slow[2] > 1e-6 * slow[-1]
