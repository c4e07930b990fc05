"""Records that come with the package, to try models on.

What was measured keeps the licences of those who measured it, which lie beside the files.
"""

from robustpolish.datasets.friction_damper import friction_damper
from robustpolish.datasets.magnetic_beam import magnetic_beam
from robustpolish.datasets.mr_damper import mr_damper
from robustpolish.datasets.pendulum_decay import pendulum_decay
from robustpolish.datasets.sticky_slide import sticky_slide

__all__ = ["friction_damper", "magnetic_beam", "mr_damper", "pendulum_decay", "sticky_slide"]
