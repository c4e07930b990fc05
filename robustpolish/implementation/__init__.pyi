from .certify_sampled import (
    certify_sampled as certify_sampled,
)
from .realization import (
    emulated as emulated,
)
from .sampled.certificate import (
    SampledCertificate as SampledCertificate,
)
from .sampled_design import (
    SampledDesign as SampledDesign,
)
from .sampled_design import (
    plant_at_samples as plant_at_samples,
)

__all__ = [
    "SampledCertificate",
    "SampledDesign",
    "certify_sampled",
    "emulated",
    "plant_at_samples",
]
