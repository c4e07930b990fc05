"""Proofs about linear systems: definite matrices, bounded-real lemma, covered frequencies."""
