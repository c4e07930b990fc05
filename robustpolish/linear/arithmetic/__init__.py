"""Exact and enclosed numbers: rational matrices, balls, definiteness, Riccati equations."""
