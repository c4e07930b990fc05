"""Comparison and fit of frequency responses."""
