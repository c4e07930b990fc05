"""The polishing brush on its surface: makes the disturbance that the machine has to stand."""

from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.listing.response import listing_response
from robustpolish.brush.parameters import RUN_STIFFNESS, BrushParameters
from robustpolish.brush.simulate import simulate_brush
from robustpolish.brush.surface import Surface
from robustpolish.brush.tool_path import tool_position, tool_velocity

__all__ = [
    "RUN_STIFFNESS",
    "BrushParameters",
    "ListingDefects",
    "Surface",
    "listing_response",
    "simulate_brush",
    "tool_position",
    "tool_velocity",
]
