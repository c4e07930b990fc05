"""Learn: compare with measurements, see where the model fails, name the missing effect."""

from robustpolish.identification.compare.compare import compare as compare
from robustpolish.identification.compare.comparison import Comparison as Comparison
from robustpolish.identification.compare.steps import StepRun as StepRun
from robustpolish.identification.compare.steps import step_runs as step_runs
from robustpolish.identification.discover.diagnose import diagnose as diagnose
from robustpolish.identification.experiments.tell_apart import tell_apart as tell_apart
from robustpolish.identification.experiments.told import ToldApart as ToldApart
from robustpolish.identification.findings.diagnosis import Diagnosis as Diagnosis
from robustpolish.identification.findings.force_map import ForceMap as ForceMap
from robustpolish.identification.findings.ledger import Ledger as Ledger
from robustpolish.identification.findings.record_error import OutputError as OutputError
from robustpolish.identification.findings.record_error import RecordError as RecordError
from robustpolish.identification.findings.refitted import Refit as Refit
from robustpolish.identification.findings.sector import effect_sector as effect_sector
from robustpolish.identification.frequency.amplitudes import (
    AmplitudeDependence as AmplitudeDependence,
)
from robustpolish.identification.frequency.amplitudes import AmplitudeMode as AmplitudeMode
from robustpolish.identification.frequency.amplitudes import (
    amplitude_dependence as amplitude_dependence,
)
from robustpolish.identification.frequency.comparison import (
    FrequencyComparison as FrequencyComparison,
)
from robustpolish.identification.frequency.comparison import ModeComparison as ModeComparison
from robustpolish.identification.frequency.comparison import PairError as PairError
from robustpolish.identification.numbers.refit import refit as refit
from robustpolish.identification.residuals.analysis import ResidualAnalysis as ResidualAnalysis
from robustpolish.identification.residuals.analysis import residual_analysis as residual_analysis
from robustpolish.identification.residuals.correlation import autocorrelation as autocorrelation
from robustpolish.identification.residuals.correlation import coherence as coherence
from robustpolish.identification.residuals.correlation import cross_correlation as cross_correlation
