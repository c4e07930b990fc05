from . import (
    datasets as datasets,
)
from . import (
    effects as effects,
)
from . import (
    errors as errors,
)
from . import (
    implementation as implementation,
)
from . import (
    linear as linear,
)
from . import (
    plots as plots,
)
from . import (
    polishing as polishing,
)
from . import (
    results as results,
)
from . import (
    rotor as rotor,
)
from . import (
    signals as signals,
)
from . import (
    simulation as simulation,
)
from . import (
    tunable as tunable,
)
from . import (
    uncertain as uncertain,
)
from .app.machine_design import (
    design_machine as design_machine,
)
from .app.machine_design import (
    read_design_task as read_design_task,
)
from .base.sweep import (
    sweep as sweep,
)
from .base.versions import (
    show_versions as show_versions,
)
from .closed_loop.simulate import (
    compare_controllers as compare_controllers,
)
from .closed_loop.simulate import (
    simulate as simulate,
)
from .errors import (
    InfeasibleError as InfeasibleError,
)
from .errors import (
    InvalidInputError as InvalidInputError,
)
from .errors import (
    RobustPolishError as RobustPolishError,
)
from .errors import (
    RobustPolishWarning as RobustPolishWarning,
)
from .errors import (
    SolverError as SolverError,
)
from .identification.compare import (
    compare as compare,
)
from .identification.diagnose import (
    diagnose as diagnose,
)
from .identification.look import (
    look as look,
)
from .identification.refit import (
    refit as refit,
)
from .identification.residuals import (
    residual_analysis as residual_analysis,
)
from .identification.tell_apart import (
    tell_apart as tell_apart,
)
from .identification.trial import (
    try_effect as try_effect,
)
from .linear.modes import (
    modes as modes,
)
from .linear.norms.h2 import (
    h2_norm as h2_norm,
)
from .linear.norms.hinf import (
    hinf_norm as hinf_norm,
)
from .loading import (
    load as load,
)
from .loops.analysis import (
    loop_analysis as loop_analysis,
)
from .loops.requirements import (
    LoopRequirements as LoopRequirements,
)
from .machines.effects.user_defined import (
    effect as effect,
)
from .machines.mechanical.equations import (
    Equations as Equations,
)
from .machines.mechanical.model import (
    MechanicalModel as MechanicalModel,
)
from .machines.mechanical.parts import (
    Damper as Damper,
)
from .machines.mechanical.parts import (
    Dof as Dof,
)
from .machines.mechanical.parts import (
    Input as Input,
)
from .machines.mechanical.parts import (
    Output as Output,
)
from .machines.mechanical.parts import (
    Ratio as Ratio,
)
from .machines.mechanical.parts import (
    Spring as Spring,
)
from .plants.linearization import (
    linearize as linearize,
)
from .plants.plant import (
    GeneralizedPlant as GeneralizedPlant,
)
from .plants.uncertain.build import (
    feedback as feedback,
)
from .plants.weights import (
    mixed_sensitivity as mixed_sensitivity,
)
from .plants.weights import (
    weight as weight,
)
from .polishing.air_bearing import (
    air_bearing as air_bearing,
)
from .robust.questions import (
    robust_performance as robust_performance,
)
from .robust.questions import (
    robust_sector as robust_sector,
)
from .robust.questions import (
    robust_stability as robust_stability,
)
from .robust.questions import (
    worst_case_gain as worst_case_gain,
)
from .robust.structured_singular_value import (
    structured_singular_value as structured_singular_value,
)
from .signals.frequency_response import (
    estimate_frequency_response as estimate_frequency_response,
)
from .signals.frequency_response import (
    read_frequency_response as read_frequency_response,
)
from .signals.read import (
    read_measurement as read_measurement,
)
from .synthesis.certificate import (
    certify as certify,
)
from .synthesis.compare import (
    compare_methods as compare_methods,
)
from .synthesis.compare import (
    trade_off as trade_off,
)
from .synthesis.design import (
    given_controller as given_controller,
)
from .synthesis.loop_shaping import (
    loop_shaping as loop_shaping,
)
from .synthesis.output_feedback.output_feedback import (
    output_feedback as output_feedback,
)
from .synthesis.problem.matrices import (
    channel as channel,
)
from .synthesis.problem.pole_regions import (
    Disk as Disk,
)
from .synthesis.problem.pole_regions import (
    HalfPlane as HalfPlane,
)
from .synthesis.problem.pole_regions import (
    Sector as Sector,
)
from .synthesis.scheduled.robust_state_feedback import (
    robust_state_feedback as robust_state_feedback,
)
from .synthesis.scheduled.scheduled_feedback import (
    scheduled_feedback as scheduled_feedback,
)
from .synthesis.state_feedback.state_feedback import (
    state_feedback as state_feedback,
)
from .synthesis.structured.methods import (
    observer_feedback as observer_feedback,
)
from .synthesis.structured.methods import (
    passive_feedback as passive_feedback,
)
from .synthesis.structured.methods import (
    static_output_feedback as static_output_feedback,
)
from .synthesis.structured.methods import (
    structured_output_feedback as structured_output_feedback,
)
from .synthesis.structured.mixed import (
    mixed_output_feedback as mixed_output_feedback,
)
from .synthesis.structured.mixed import (
    mixed_state_feedback as mixed_state_feedback,
)
from .synthesis.uncertain.robust_output_feedback import (
    robust_output_feedback as robust_output_feedback,
)

__version__: str

__all__ = [
    "Damper",
    "Disk",
    "Dof",
    "Equations",
    "GeneralizedPlant",
    "HalfPlane",
    "InfeasibleError",
    "Input",
    "InvalidInputError",
    "LoopRequirements",
    "MechanicalModel",
    "Output",
    "Ratio",
    "RobustPolishError",
    "RobustPolishWarning",
    "Sector",
    "SolverError",
    "Spring",
    "air_bearing",
    "certify",
    "channel",
    "compare",
    "compare_controllers",
    "compare_methods",
    "datasets",
    "design_machine",
    "diagnose",
    "effect",
    "effects",
    "errors",
    "estimate_frequency_response",
    "feedback",
    "given_controller",
    "h2_norm",
    "hinf_norm",
    "implementation",
    "linear",
    "linearize",
    "load",
    "look",
    "loop_analysis",
    "loop_shaping",
    "mixed_output_feedback",
    "mixed_sensitivity",
    "mixed_state_feedback",
    "modes",
    "observer_feedback",
    "output_feedback",
    "passive_feedback",
    "plots",
    "polishing",
    "read_design_task",
    "read_frequency_response",
    "read_measurement",
    "refit",
    "residual_analysis",
    "results",
    "robust_output_feedback",
    "robust_performance",
    "robust_sector",
    "robust_stability",
    "robust_state_feedback",
    "rotor",
    "scheduled_feedback",
    "show_versions",
    "signals",
    "simulate",
    "simulation",
    "state_feedback",
    "static_output_feedback",
    "structured_output_feedback",
    "structured_singular_value",
    "sweep",
    "tell_apart",
    "trade_off",
    "tunable",
    "uncertain",
    "weight",
    "worst_case_gain",
]
