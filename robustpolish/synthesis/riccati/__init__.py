"""Riccati equations, infima of gamma and lower bounds."""
