"""Learn: compare with measurements, see where the model fails, name the missing effect."""

from robustpolish.identification.compare import compare as compare
from robustpolish.identification.comparison import Comparison as Comparison
from robustpolish.identification.comparison import OutputError as OutputError
