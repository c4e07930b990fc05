"""Sampled loops run over time, with the limits of their actuators."""
