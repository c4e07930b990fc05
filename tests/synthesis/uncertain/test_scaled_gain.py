import numpy as np
import pytest

from robustpolish.robust.loop_model import DeltaBlock, DeltaStructure
from robustpolish.robust.scalings import Inequality, Space, initial_scalings, reduce_level
from robustpolish.synthesis.uncertain.scaled_gain import ScaledGain, Scalings

BLOCKS = (
    DeltaBlock("real", 2),
    DeltaBlock("complex", 2),
    DeltaBlock("full", 1, 2, 3),
    DeltaBlock("real"),
    DeltaBlock("full", 1, 2, 1),
)


@pytest.fixture
def case():
    random = np.random.default_rng(0)
    structure = DeltaStructure(BLOCKS)
    scalings = Scalings(structure)
    nz, nw = structure.shape
    M = random.standard_normal((3, nz, nw)) + 1j * random.standard_normal((3, nz, nw))
    weights = random.standard_normal((3, nw, nw)) + 1j * random.standard_normal((3, nw, nw))
    weights = weights + np.conj(weights.swapaxes(1, 2))
    theta = 0.3 * random.standard_normal((3, scalings.size))
    return scalings, theta, M, weights


def _sum(scalings, theta, M, weights):
    return np.einsum("kij,kji->", weights, ScaledGain(scalings, theta, M).H).real


def test_derivatives_over_scalings_and_m_are_those_of_differences(case):
    scalings, theta, M, weights = case
    on_M, on_theta = ScaledGain(scalings, theta, M).back(weights)
    random, h = np.random.default_rng(1), 1e-6
    for _ in range(5):
        step = random.standard_normal(theta.shape)
        ends = [_sum(scalings, theta + sign * h * step, M, weights) for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx((on_theta * step).sum(), rel=1e-6)
        step = random.standard_normal(M.shape) + 1j * random.standard_normal(M.shape)
        ends = [_sum(scalings, theta, M + sign * h * step, weights) for sign in (1, -1)]
        expected = np.einsum("kwz,kzw->", on_M, step).real
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("gain", [1.0, 7.0])
def test_scalings_of_the_analysis_prove_the_same_level(case, gain):
    scalings, _, M, _ = case
    space = Space(scalings.structure, (False,) * len(BLOCKS))
    inequality = Inequality(space, M[:1] / gain)
    best = reduce_level(inequality, initial_scalings(inequality))
    theta = scalings.of_weights(best.x, space, gain)
    H = ScaledGain(scalings, theta[None], M[:1]).H[0]
    assert np.linalg.eigvalsh(H)[-1] == pytest.approx(best.square * gain**2, rel=1e-9)
