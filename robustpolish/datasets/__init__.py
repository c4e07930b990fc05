"""Measured records that come with the package, to try models on.

They keep the licences of those who measured them, which lie beside the files.
"""

from robustpolish.datasets.friction_damper import friction_damper
from robustpolish.datasets.magnetic_beam import magnetic_beam

__all__ = ["friction_damper", "magnetic_beam"]
