from .compare import (
    Comparison as Comparison,
)
from .compare import (
    StepRun as StepRun,
)
from .compare import (
    compare as compare,
)
from .compare import (
    step_runs as step_runs,
)
from .diagnose import (
    diagnose as diagnose,
)
from .diagnosis import (
    Diagnosis as Diagnosis,
)
from .findings import (
    ForceMap as ForceMap,
)
from .findings import (
    Ledger as Ledger,
)
from .fit.result import (
    Refit as Refit,
)
from .fit.result import (
    effect_sector as effect_sector,
)
from .free_runs import (
    OutputError as OutputError,
)
from .free_runs import (
    RecordError as RecordError,
)
from .frequency.comparison import (
    AmplitudeDependence as AmplitudeDependence,
)
from .frequency.comparison import (
    AmplitudeMode as AmplitudeMode,
)
from .frequency.comparison import (
    FrequencyComparison as FrequencyComparison,
)
from .frequency.comparison import (
    ModeComparison as ModeComparison,
)
from .frequency.comparison import (
    PairError as PairError,
)
from .frequency.comparison import (
    amplitude_dependence as amplitude_dependence,
)
from .look import (
    RecordLook as RecordLook,
)
from .look import (
    look as look,
)
from .refit import (
    refit as refit,
)
from .residual_tests import (
    autocorrelation as autocorrelation,
)
from .residual_tests import (
    coherence as coherence,
)
from .residual_tests import (
    cross_correlation as cross_correlation,
)
from .residuals import (
    ResidualAnalysis as ResidualAnalysis,
)
from .residuals import (
    residual_analysis as residual_analysis,
)
from .tell_apart import (
    ToldApart as ToldApart,
)
from .tell_apart import (
    tell_apart as tell_apart,
)

__all__ = [
    "AmplitudeDependence",
    "AmplitudeMode",
    "Comparison",
    "Diagnosis",
    "ForceMap",
    "FrequencyComparison",
    "Ledger",
    "ModeComparison",
    "OutputError",
    "PairError",
    "RecordError",
    "RecordLook",
    "Refit",
    "ResidualAnalysis",
    "StepRun",
    "ToldApart",
    "amplitude_dependence",
    "autocorrelation",
    "coherence",
    "compare",
    "cross_correlation",
    "diagnose",
    "effect_sector",
    "look",
    "refit",
    "residual_analysis",
    "step_runs",
    "tell_apart",
]
