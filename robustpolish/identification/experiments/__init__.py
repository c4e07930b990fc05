"""Experiment design that separates two models."""
