"""From a controller on paper to one that can be built: reduced, sampled, coded."""

from robustpolish.implementation.discretization.at_samples import plant_at_samples
from robustpolish.implementation.discretization.certify_sampled import certify_sampled
from robustpolish.implementation.discretization.emulation import emulated
from robustpolish.implementation.discretization.sampled_design import SampledDesign
from robustpolish.implementation.sampled.certificate import SampledCertificate

__all__ = [
    "SampledCertificate",
    "SampledDesign",
    "certify_sampled",
    "emulated",
    "plant_at_samples",
]
