"""Models of few unknowns: a basis from equilibria, and few weighted elements in place of all."""
