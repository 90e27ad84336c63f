"""Equilibrium finite elements for slow tests of soft materials, with exact sensitivities.

The input of `kolsky.equilibrium.solve.solve` is a constant `kolsky.equilibrium.model.Model`, with histories.
A model has a `kolsky.equilibrium.meshes.Mesh`, a `kolsky.equilibrium.solid.Solid`, supports and loads. The
result is a `kolsky.equilibrium.solution.Solution` with displacements, forces and an outcome.
`kolsky.equilibrium.sensitivity` differentiates it.
"""
