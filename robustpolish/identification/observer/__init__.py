"""Kalman filters for states and unknown forces."""
