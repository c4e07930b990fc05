"""Machines and plants: parameters, air bearing, generalised plant, linearisation."""

from robustpolish.models.generalized_plant import GeneralizedPlant

__all__ = ["GeneralizedPlant"]
