"""Robust synthesis: D-K iteration and scenarios."""
