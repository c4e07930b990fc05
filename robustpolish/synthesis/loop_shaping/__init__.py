"""Loop shaping by normalised coprime factors, its margin, and the gap between plants."""
