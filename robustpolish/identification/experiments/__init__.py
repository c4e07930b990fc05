"""Experiments that would tell machines apart that a record does not."""
