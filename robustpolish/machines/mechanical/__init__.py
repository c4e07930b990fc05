"""Masses, springs, dampers and effects: data below, matrices, files and tables on top."""
