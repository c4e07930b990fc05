"""Controllers with certificates: one method per file, and the certificate that judges them all."""

from robustpolish.synthesis.certificate import Certificate, certify
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.pole_regions import Disk, HalfPlane, Sector
from robustpolish.synthesis.published_controllers import PUBLISHED_CONTROLLERS, published_gain
from robustpolish.synthesis.state_feedback import state_feedback

__all__ = [
    "PUBLISHED_CONTROLLERS",
    "Certificate",
    "Design",
    "Disk",
    "HalfPlane",
    "Sector",
    "certify",
    "published_gain",
    "state_feedback",
]
