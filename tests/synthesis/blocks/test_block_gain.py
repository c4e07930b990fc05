"""K of wired blocks: its gradient."""

import numpy as np
import pytest
from three_loops import blocks, plant

from robustpolish.synthesis.problem.scaling import scale_plant
from robustpolish.synthesis.structured.block_wiring import block_parametrisation, place_blocks


def test_back_is_the_gradient():
    P = plant()
    placement = place_blocks(blocks(), P)
    gain = block_parametrisation(placement, scale_plant(P))
    rng = np.random.default_rng(1)
    theta = 0.3 * rng.normal(size=gain.size)
    theta[[n.key for n in placement.numbers].index("notch_x.depth")] = 0.4  # inside its limits
    weights = rng.normal(size=gain.gain(theta).shape)
    step = 1e-6
    slopes = [
        np.sum(weights * (gain.gain(theta + step * e) - gain.gain(theta - step * e))) / (2 * step)
        for e in np.eye(gain.size)
    ]
    assert gain.back(theta, weights) == pytest.approx(np.array(slopes), rel=1e-6, abs=1e-8)
