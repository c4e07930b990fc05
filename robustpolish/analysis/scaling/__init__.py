"""State-space matrices as plain arrays, their units and their decoupled parts."""
