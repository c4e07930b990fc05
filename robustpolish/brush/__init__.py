"""The polishing brush on its surface: makes the disturbance that the machine has to stand."""

from robustpolish.brush.contact.comparison import ContactComparison, compare_contact_laws
from robustpolish.brush.contact.friction_cone import FrictionCone
from robustpolish.brush.contact.impact import impact_depth, quarter_period, rim_mass
from robustpolish.brush.contact.landing import land
from robustpolish.brush.contact.laws import (
    EventImpulse,
    HuntCrossley,
    LinearSpring,
    ListingImpulse,
)
from robustpolish.brush.contact.resultant import ResultantForces, resultant_forces, rolling_angle
from robustpolish.brush.contact.study import ForceStudy, force_study
from robustpolish.brush.fit import BrushFit, check_brush_fit
from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.listing.response import listing_response
from robustpolish.brush.parameters import RUN_STIFFNESS, BrushParameters
from robustpolish.brush.paths.tool_path import ToolPath
from robustpolish.brush.picture import plot_polishing
from robustpolish.brush.removal import removal_map, removal_of_force
from robustpolish.brush.simulate import simulate_brush
from robustpolish.brush.surfaces.mould import Mould
from robustpolish.brush.surfaces.trough import Surface
from robustpolish.brush.tool_path import tool_position, tool_velocity

__all__ = [
    "RUN_STIFFNESS",
    "BrushFit",
    "BrushParameters",
    "ContactComparison",
    "EventImpulse",
    "ForceStudy",
    "FrictionCone",
    "HuntCrossley",
    "LinearSpring",
    "ListingDefects",
    "ListingImpulse",
    "Mould",
    "ResultantForces",
    "Surface",
    "ToolPath",
    "check_brush_fit",
    "compare_contact_laws",
    "force_study",
    "impact_depth",
    "land",
    "listing_response",
    "plot_polishing",
    "quarter_period",
    "removal_map",
    "removal_of_force",
    "resultant_forces",
    "rim_mass",
    "rolling_angle",
    "simulate_brush",
    "tool_position",
    "tool_velocity",
]
