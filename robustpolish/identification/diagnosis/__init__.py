"""Results of a diagnosis."""
