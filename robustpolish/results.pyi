from .app.design_task import (
    DesignTask as DesignTask,
)
from .app.machine_design import (
    ChannelGain as ChannelGain,
)
from .app.machine_design import (
    MachineDesign as MachineDesign,
)
from .closed_loop.robustness import (
    RobustnessCheck as RobustnessCheck,
)
from .closed_loop.sampled_loops import (
    SampledLoops as SampledLoops,
)
from .closed_loop.simulate import (
    ControllerComparison as ControllerComparison,
)
from .identification.compare import (
    Comparison as Comparison,
)
from .identification.compare import (
    StepRun as StepRun,
)
from .identification.diagnosis import (
    Diagnosis as Diagnosis,
)
from .identification.findings import (
    ForceMap as ForceMap,
)
from .identification.findings import (
    Ledger as Ledger,
)
from .identification.fit.result import (
    Refit as Refit,
)
from .identification.free_runs import (
    OutputError as OutputError,
)
from .identification.free_runs import (
    RecordError as RecordError,
)
from .identification.frequency.comparison import (
    AmplitudeDependence as AmplitudeDependence,
)
from .identification.frequency.comparison import (
    AmplitudeMode as AmplitudeMode,
)
from .identification.frequency.comparison import (
    FrequencyComparison as FrequencyComparison,
)
from .identification.frequency.comparison import (
    ModeComparison as ModeComparison,
)
from .identification.frequency.comparison import (
    PairError as PairError,
)
from .identification.look import (
    RecordLook as RecordLook,
)
from .identification.residuals import (
    ResidualAnalysis as ResidualAnalysis,
)
from .identification.tell_apart import (
    ToldApart as ToldApart,
)
from .identification.trial import (
    Trial as Trial,
)
from .implementation.sampled.certificate import (
    SampledCertificate as SampledCertificate,
)
from .implementation.sampled_design import (
    SampledDesign as SampledDesign,
)
from .linear.delay_stability import (
    DelayStability as DelayStability,
)
from .linear.modes import (
    Mode as Mode,
)
from .linear.modes import (
    Modes as Modes,
)
from .linear.norms.h2 import (
    H2Norm as H2Norm,
)
from .linear.norms.hinf import (
    AxisZero as AxisZero,
)
from .linear.norms.hinf import (
    HinfNorm as HinfNorm,
)
from .linear.norms.lmi import (
    LmiCheck as LmiCheck,
)
from .linear.response import (
    Response as Response,
)
from .linear.scaling import (
    Block as Block,
)
from .linear.scaling import (
    Prescaled as Prescaled,
)
from .linear.scaling import (
    Scaling as Scaling,
)
from .linear.stability import (
    Feasibility as Feasibility,
)
from .linear.stability import (
    ModeTest as ModeTest,
)
from .linear.stability import (
    PbhTest as PbhTest,
)
from .linear.stability import (
    Stability as Stability,
)
from .loops.analysis import (
    LoopAnalysis as LoopAnalysis,
)
from .loops.analysis import (
    MeasuredLoopAnalysis as MeasuredLoopAnalysis,
)
from .loops.disk_margins import (
    DiskMargin as DiskMargin,
)
from .loops.margins import (
    Crossing as Crossing,
)
from .loops.margins import (
    LoopMargins as LoopMargins,
)
from .loops.margins import (
    MarginsAtOnce as MarginsAtOnce,
)
from .loops.performance import (
    Effort as Effort,
)
from .loops.performance import (
    LoopBandwidth as LoopBandwidth,
)
from .loops.performance import (
    MeasuredSensitivities as MeasuredSensitivities,
)
from .loops.performance import (
    SampleRate as SampleRate,
)
from .loops.performance import (
    Sensitivities as Sensitivities,
)
from .machines.effects.learned_law import (
    LearnedLaw as LearnedLaw,
)
from .machines.rotor.modes import (
    Campbell as Campbell,
)
from .machines.rotor.modes import (
    RotorModes as RotorModes,
)
from .machines.rotor.modes import (
    WhirlMode as WhirlMode,
)
from .machines.rotor.rotor import (
    ReducedRotor as ReducedRotor,
)
from .machines.simulation import (
    NonlinearResponse as NonlinearResponse,
)
from .plants.linearization import (
    Linearization as Linearization,
)
from .plants.uncertain.build import (
    Ellipsoid as Ellipsoid,
)
from .plants.uncertain.cover import (
    Cover as Cover,
)
from .polishing.coupled_loops import (
    CoupledComparison as CoupledComparison,
)
from .polishing.design import (
    BuildableBrushDesign as BuildableBrushDesign,
)
from .polishing.design import (
    HardwareLimit as HardwareLimit,
)
from .polishing.force_control import (
    ForceComparison as ForceComparison,
)
from .polishing.ideal import (
    BrushDesign as BrushDesign,
)
from .polishing.simulate import (
    BrushFit as BrushFit,
)
from .polishing.thesis.contact_study import (
    ContactComparison as ContactComparison,
)
from .polishing.thesis.contact_study import (
    ForceStudy as ForceStudy,
)
from .robust.questions import (
    RobustPerformance as RobustPerformance,
)
from .robust.questions import (
    RobustStability as RobustStability,
)
from .robust.questions import (
    SectorStability as SectorStability,
)
from .robust.questions import (
    WorstCaseGain as WorstCaseGain,
)
from .robust.structured_singular_value import (
    StructuredSingularValue as StructuredSingularValue,
)
from .synthesis.certificate import (
    Certificate as Certificate,
)
from .synthesis.compare import (
    MethodComparison as MethodComparison,
)
from .synthesis.compare import (
    MethodResult as MethodResult,
)
from .synthesis.compare import (
    TradeOff as TradeOff,
)
from .synthesis.design import (
    Design as Design,
)
from .synthesis.problem.pole_regions import (
    PassiveElement as PassiveElement,
)
from .synthesis.scheduled.robust_state_feedback import (
    RobustStateFeedback as RobustStateFeedback,
)
from .synthesis.scheduled.scheduled_feedback import (
    ScheduledDesign as ScheduledDesign,
)
from .synthesis.structured.block_parts import (
    TunedBlock as TunedBlock,
)
from .synthesis.structured.block_parts import (
    TunedNumber as TunedNumber,
)
from .synthesis.uncertain.robust_output_feedback import (
    RobustDesign as RobustDesign,
)

__all__ = [
    "AmplitudeDependence",
    "AmplitudeMode",
    "AxisZero",
    "Block",
    "BrushDesign",
    "BrushFit",
    "BuildableBrushDesign",
    "Campbell",
    "Certificate",
    "ChannelGain",
    "Comparison",
    "ContactComparison",
    "ControllerComparison",
    "CoupledComparison",
    "Cover",
    "Crossing",
    "DelayStability",
    "Design",
    "DesignTask",
    "Diagnosis",
    "DiskMargin",
    "Effort",
    "Ellipsoid",
    "Feasibility",
    "ForceComparison",
    "ForceMap",
    "ForceStudy",
    "FrequencyComparison",
    "H2Norm",
    "HardwareLimit",
    "HinfNorm",
    "LearnedLaw",
    "Ledger",
    "Linearization",
    "LmiCheck",
    "LoopAnalysis",
    "LoopBandwidth",
    "LoopMargins",
    "MachineDesign",
    "MarginsAtOnce",
    "MeasuredLoopAnalysis",
    "MeasuredSensitivities",
    "MethodComparison",
    "MethodResult",
    "Mode",
    "ModeComparison",
    "ModeTest",
    "Modes",
    "NonlinearResponse",
    "OutputError",
    "PairError",
    "PassiveElement",
    "PbhTest",
    "Prescaled",
    "RecordError",
    "RecordLook",
    "ReducedRotor",
    "Refit",
    "ResidualAnalysis",
    "Response",
    "RobustDesign",
    "RobustPerformance",
    "RobustStability",
    "RobustStateFeedback",
    "RobustnessCheck",
    "RotorModes",
    "SampleRate",
    "SampledCertificate",
    "SampledDesign",
    "SampledLoops",
    "Scaling",
    "ScheduledDesign",
    "SectorStability",
    "Sensitivities",
    "Stability",
    "StepRun",
    "StructuredSingularValue",
    "ToldApart",
    "TradeOff",
    "TunedBlock",
    "TunedNumber",
    "WhirlMode",
    "WorstCaseGain",
]
