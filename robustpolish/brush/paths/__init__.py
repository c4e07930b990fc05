"""Paths of the tool over a mould: lines, spirals, contours, and those of a file."""
