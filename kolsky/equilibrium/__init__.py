"""Equilibrium finite elements for slow tests of soft materials, with exact sensitivities.

A constant `kolsky.equilibrium.model.Model` (a `kolsky.equilibrium.meshes.Mesh`, a
`kolsky.equilibrium.solid.Solid`, supports and loads) and histories go into
`kolsky.equilibrium.solve.solve`; out
comes a `kolsky.equilibrium.solution.Solution` with displacements, forces and an outcome.
`kolsky.equilibrium.sensitivity` differentiates it.
"""
