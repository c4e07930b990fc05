"""Modes, stability, zeros, and which modes can be moved or seen."""
