"""The path of the tool, against finite differences."""

import numpy as np

from robustpolish.polishing.dataset import tool_position, tool_velocity
from robustpolish.polishing.parameters import BrushParameters


def test_velocity_is_the_derivative_of_the_place() -> None:
    brush, time, step = BrushParameters(), np.linspace(0.0, 1.0, 11), 1e-6
    moved = tool_position(time + step, brush) - tool_position(time - step, brush)
    np.testing.assert_allclose(tool_velocity(time, brush), moved / (2 * step), rtol=0, atol=1e-9)
    start = [2 * brush.rotation_radius + brush.radius, 0.0]
    np.testing.assert_allclose(tool_position(0.0, brush), start)
