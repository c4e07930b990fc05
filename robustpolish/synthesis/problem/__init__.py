"""Generalised plants as matrices: scaling, decoupling, solvability."""
