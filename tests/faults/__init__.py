"""Faults where results are written: kills, refusals, clocks that jump, slow disks."""
