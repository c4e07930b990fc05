"""Robust control design with certificates, for machines with contact."""

from robustpolish.models import GeneralizedPlant

__version__ = "0.1.0"

__all__ = ["GeneralizedPlant"]
