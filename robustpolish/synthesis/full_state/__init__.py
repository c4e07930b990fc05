"""The steps of a state feedback u = F x: matrices, inequalities, Riccati equations, bounds."""
