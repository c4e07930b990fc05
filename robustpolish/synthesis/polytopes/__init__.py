"""Gains and controllers for all plants of a polytope, fixed or scheduled, with their proofs."""
