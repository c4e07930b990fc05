import numpy as np

import robustpolish as rp
from robustpolish.polishing.tool_path import evaluate_path


def test_compiled_code_follows_the_same_path():
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
    place, velocity = np.zeros(3), np.zeros(3)
    for time in np.linspace(0.0, path.duration, 37):
        evaluate_path(time, path.packed, place, velocity)
        np.testing.assert_allclose(place[:2], path.position(time), atol=1e-15)
        np.testing.assert_allclose(velocity[:2], path.velocity(time), atol=1e-13)
