"""Linear systems with the tangent stiffness: `implicit.linear.factorise` chooses the solver."""
