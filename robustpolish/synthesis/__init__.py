"""Controllers with certificates: one method per file, and the certificate that judges them all."""

from robustpolish.synthesis.certificate import Certificate, certify
from robustpolish.synthesis.design import Design

__all__ = ["Certificate", "Design", "certify"]
