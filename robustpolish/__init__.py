"""Robust control design with certificates, for machines with contact."""

from robustpolish.models import AirBearingParameters, GeneralizedPlant, air_bearing

__version__ = "0.1.0"

__all__ = ["AirBearingParameters", "GeneralizedPlant", "air_bearing"]
