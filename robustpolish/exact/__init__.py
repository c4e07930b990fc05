"""Exact and enclosed numbers: rational matrices, ball arithmetic, definiteness."""
