"""Blocks whose numbers are tuned: what they consist of, and the controller that they make."""
