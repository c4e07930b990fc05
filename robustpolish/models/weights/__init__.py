"""Weights, and the plants that they make of a system: what a loop is asked for."""

from robustpolish.models.weights.mixed_sensitivity import mixed_sensitivity as mixed_sensitivity
from robustpolish.models.weights.weight import weight as weight
