"""Loop shaping by normalised coprime factors."""
