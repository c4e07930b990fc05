"""Moulds: surfaces that the brush polishes."""
