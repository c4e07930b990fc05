"""Nonsmooth optimisation of closed-loop norms."""
