"""Branch and bound over real numbers, by polynomials in Bernstein's form."""
