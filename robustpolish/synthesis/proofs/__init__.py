"""Proofs of stability and norm of a closed loop."""
