"""Loops of real numbers: where rays of them leave stability, and the exact margin of one."""
