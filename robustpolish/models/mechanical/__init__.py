"""Masses, springs, dampers and effects: data below, matrices, files and tables on top."""

from robustpolish.models.mechanical.model import MechanicalModel as MechanicalModel
