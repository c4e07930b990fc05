"""Simulation: the exact response of linear systems."""

from robustpolish.simulation.linear_response import Response, first_order_hold, linear_response

__all__ = ["Response", "first_order_hold", "linear_response"]
