"""Records that come with the package, to try models on.

What was measured keeps the licences of those who measured it, which lie beside the files.
"""

from robustpolish.datasets.friction_damper import friction_damper
from robustpolish.datasets.magnetic_beam import magnetic_beam
from robustpolish.datasets.sticky_slide import sticky_slide

__all__ = ["friction_damper", "magnetic_beam", "sticky_slide"]
