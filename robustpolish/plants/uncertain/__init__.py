"""Machines whose numbers and dynamics are known within bounds only."""
