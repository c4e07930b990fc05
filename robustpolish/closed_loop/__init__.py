"""Controllers meet disturbances."""

from robustpolish.closed_loop.comparison import ControllerComparison, compare_controllers
from robustpolish.closed_loop.simulation import simulate

__all__ = ["ControllerComparison", "compare_controllers", "simulate"]
