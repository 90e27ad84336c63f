"""Linear systems with the tangent stiffness. `kolsky.equilibrium.linear.solvers` chooses the solver."""
