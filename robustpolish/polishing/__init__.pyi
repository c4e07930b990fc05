from .air_bearing import (
    AirBearingParameters as AirBearingParameters,
)
from .air_bearing import (
    DampingCoefficients as DampingCoefficients,
)
from .air_bearing import (
    PolishingHardware as PolishingHardware,
)
from .air_bearing import (
    air_bearing as air_bearing,
)
from .air_bearing import (
    air_bearing_model as air_bearing_model,
)
from .air_bearing import (
    polishing_plant as polishing_plant,
)
from .brush import (
    tool_position as tool_position,
)
from .brush import (
    tool_velocity as tool_velocity,
)
from .coupled_loops import (
    CoupledComparison as CoupledComparison,
)
from .coupled_loops import (
    brush_record as brush_record,
)
from .coupled_loops import (
    compare_coupled as compare_coupled,
)
from .coupled_loops import (
    linearize_with_brush as linearize_with_brush,
)
from .coupled_loops import (
    simulate_coupled as simulate_coupled,
)
from .design import (
    BuildableBrushDesign as BuildableBrushDesign,
)
from .design import (
    HardwareLimit as HardwareLimit,
)
from .design import (
    design_against_brush as design_against_brush,
)
from .force_control import (
    ForceComparison as ForceComparison,
)
from .force_control import (
    ForceControl as ForceControl,
)
from .force_control import (
    PolishingAxis as PolishingAxis,
)
from .force_control import (
    admittance_control as admittance_control,
)
from .force_control import (
    compare_force_control as compare_force_control,
)
from .force_control import (
    height_deviation as height_deviation,
)
from .force_control import (
    hinf_force_control as hinf_force_control,
)
from .force_control import (
    impedance_control as impedance_control,
)
from .force_control import (
    passive_stiffness as passive_stiffness,
)
from .force_control import (
    plot_polishing as plot_polishing,
)
from .force_control import (
    removal_map as removal_map,
)
from .force_control import (
    removal_of_force as removal_of_force,
)
from .ideal import (
    BrushDesign as BrushDesign,
)
from .monte_carlo import (
    monte_carlo as monte_carlo,
)
from .parameters import (
    RUN_STIFFNESS as RUN_STIFFNESS,
)
from .parameters import (
    BrushParameters as BrushParameters,
)
from .simulate import (
    BrushFit as BrushFit,
)
from .simulate import (
    check_brush_fit as check_brush_fit,
)
from .simulate import (
    simulate_brush as simulate_brush,
)
from .simulate import (
    simulate_disc as simulate_disc,
)
from .spindle import (
    rotating_beam as rotating_beam,
)
from .spindle import (
    spindle_rotor as spindle_rotor,
)
from .surfaces.mould import (
    Mould as Mould,
)
from .surfaces.surface import (
    Surface as Surface,
)
from .thesis.comparison import (
    PUBLISHED_CONTROLLERS as PUBLISHED_CONTROLLERS,
)
from .thesis.comparison import (
    PUBLISHED_DEVIATIONS as PUBLISHED_DEVIATIONS,
)
from .thesis.comparison import (
    PUBLISHED_NORMS as PUBLISHED_NORMS,
)
from .thesis.comparison import (
    published_gain as published_gain,
)
from .thesis.comparison import (
    thesis_comparison as thesis_comparison,
)
from .thesis.comparison import (
    thesis_structures as thesis_structures,
)
from .thesis.contact_study import (
    ContactComparison as ContactComparison,
)
from .thesis.contact_study import (
    EventImpulse as EventImpulse,
)
from .thesis.contact_study import (
    ForceStudy as ForceStudy,
)
from .thesis.contact_study import (
    FrictionCone as FrictionCone,
)
from .thesis.contact_study import (
    HuntCrossley as HuntCrossley,
)
from .thesis.contact_study import (
    LinearSpring as LinearSpring,
)
from .thesis.contact_study import (
    ListingImpulse as ListingImpulse,
)
from .thesis.contact_study import (
    ResultantForces as ResultantForces,
)
from .thesis.contact_study import (
    compare_contact_laws as compare_contact_laws,
)
from .thesis.contact_study import (
    force_study as force_study,
)
from .thesis.contact_study import (
    impact_depth as impact_depth,
)
from .thesis.contact_study import (
    land as land,
)
from .thesis.contact_study import (
    quarter_period as quarter_period,
)
from .thesis.contact_study import (
    resultant_forces as resultant_forces,
)
from .thesis.contact_study import (
    rim_mass as rim_mass,
)
from .thesis.contact_study import (
    rolling_angle as rolling_angle,
)
from .thesis.listing import (
    ListingDefects as ListingDefects,
)
from .thesis.listing import (
    listing_response as listing_response,
)
from .tool_path import (
    ToolPath as ToolPath,
)

__all__ = [
    "PUBLISHED_CONTROLLERS",
    "PUBLISHED_DEVIATIONS",
    "PUBLISHED_NORMS",
    "RUN_STIFFNESS",
    "AirBearingParameters",
    "BrushDesign",
    "BrushFit",
    "BrushParameters",
    "BuildableBrushDesign",
    "ContactComparison",
    "CoupledComparison",
    "DampingCoefficients",
    "EventImpulse",
    "ForceComparison",
    "ForceControl",
    "ForceStudy",
    "FrictionCone",
    "HardwareLimit",
    "HuntCrossley",
    "LinearSpring",
    "ListingDefects",
    "ListingImpulse",
    "Mould",
    "PolishingAxis",
    "PolishingHardware",
    "ResultantForces",
    "Surface",
    "ToolPath",
    "admittance_control",
    "air_bearing",
    "air_bearing_model",
    "brush_record",
    "check_brush_fit",
    "compare_contact_laws",
    "compare_coupled",
    "compare_force_control",
    "design_against_brush",
    "force_study",
    "height_deviation",
    "hinf_force_control",
    "impact_depth",
    "impedance_control",
    "land",
    "linearize_with_brush",
    "listing_response",
    "monte_carlo",
    "passive_stiffness",
    "plot_polishing",
    "polishing_plant",
    "published_gain",
    "quarter_period",
    "removal_map",
    "removal_of_force",
    "resultant_forces",
    "rim_mass",
    "rolling_angle",
    "rotating_beam",
    "simulate_brush",
    "simulate_coupled",
    "simulate_disc",
    "spindle_rotor",
    "thesis_comparison",
    "thesis_structures",
    "tool_position",
    "tool_velocity",
]
