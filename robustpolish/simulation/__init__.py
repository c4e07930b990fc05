"""Simulation: the exact response of linear systems, and models with physical effects."""

from robustpolish.simulation.linear_response import Response, first_order_hold, linear_response
from robustpolish.simulation.run import NonlinearResponse
from robustpolish.simulation.run import simulate as simulate_model

__all__ = [
    "NonlinearResponse",
    "Response",
    "first_order_hold",
    "linear_response",
    "simulate_model",
]
