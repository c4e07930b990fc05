"""H2 and H-infinity norms, their proofs, and singular values."""
