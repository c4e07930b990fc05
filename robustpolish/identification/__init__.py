"""Learn: compare with measurements, see where the model fails, name the missing effect."""

from robustpolish.identification.compare import compare as compare
from robustpolish.identification.comparison import Comparison as Comparison
from robustpolish.identification.comparison import OutputError as OutputError
from robustpolish.identification.diagnose import diagnose as diagnose
from robustpolish.identification.diagnosis import Diagnosis as Diagnosis
from robustpolish.identification.ledger import Ledger as Ledger
from robustpolish.identification.refit import refit as refit
from robustpolish.identification.refitted import Refit as Refit
from robustpolish.identification.residual_analysis import ResidualAnalysis as ResidualAnalysis
from robustpolish.identification.residual_analysis import residual_analysis as residual_analysis
from robustpolish.identification.residual_tests import autocorrelation as autocorrelation
from robustpolish.identification.residual_tests import coherence as coherence
from robustpolish.identification.residual_tests import cross_correlation as cross_correlation
