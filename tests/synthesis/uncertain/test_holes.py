import numpy as np
import pytest

from robustpolish.robust.loop_model import DeltaBlock, DeltaStructure
from robustpolish.synthesis.problem.matrices import PlantMatrices, close_static_loop
from robustpolish.synthesis.uncertain.scaled_gain import Scalings, unproven_frequencies


def _resonance(damping):
    """A loop of gain 1 at rest and 1 / (2 damping) at 1 rad/s, from one block to itself."""
    nothing = np.zeros
    plant = PlantMatrices(
        A=np.array([[0.0, 1.0], [-1.0, -2 * damping]]),
        B1=np.array([[0.0], [1.0]]),
        B2=nothing((2, 1)),
        C1=np.array([[1.0, 0.0]]),
        C2=nothing((1, 2)),
        D11=nothing((1, 1)),
        D12=nothing((1, 1)),
        D21=nothing((1, 1)),
        D22=nothing((1, 1)),
    )
    return close_static_loop(plant, nothing((1, 1)))


def test_a_narrow_peak_between_the_frequencies_is_found():
    loop, scalings = _resonance(1e-4), Scalings(DeltaStructure((DeltaBlock("complex"),)))
    omega = np.array([0.0, 0.1, 0.5, 3.0, np.inf])
    found, weights = unproven_frequencies(loop, scalings, omega, np.zeros((5, 0)), 2.0)
    assert len(found) == 1
    assert found[0] == pytest.approx(1.0, rel=1e-3)
    assert weights.shape == (1, 0)


def test_nothing_is_found_where_the_level_holds():
    loop, scalings = _resonance(0.9), Scalings(DeltaStructure((DeltaBlock("complex"),)))
    omega = np.array([0.0, 0.1, 3.0, np.inf])
    assert not len(unproven_frequencies(loop, scalings, omega, np.zeros((4, 0)), 1.01)[0])
