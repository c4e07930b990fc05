"""Uncertain systems: linear fractional transformations of bounded numbers and dynamics."""
