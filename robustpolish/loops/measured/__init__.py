"""Loops with a plant that is known at measured frequencies only."""
