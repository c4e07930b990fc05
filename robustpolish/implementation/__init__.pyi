from .certify_sampled import (
    certify_sampled as certify_sampled,
)
from .discretize import (
    plant_at_samples as plant_at_samples,
)
from .emulation import (
    emulated as emulated,
)
from .sampled.certificate import (
    SampledCertificate as SampledCertificate,
)
from .sampled_design import (
    SampledDesign as SampledDesign,
)

__all__ = [
    "SampledCertificate",
    "SampledDesign",
    "certify_sampled",
    "emulated",
    "plant_at_samples",
]
