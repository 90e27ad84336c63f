"""From displacements to internal forces and stiffness: Gauss points, element arrays, their sums."""
