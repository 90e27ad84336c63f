"""Linear systems with the tangent stiffness: `implicit.linear.solvers` chooses the solver."""
