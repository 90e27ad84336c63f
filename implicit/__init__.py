"""Equilibrium finite elements for slow tests of soft materials, with exact sensitivities.

A constant `implicit.model.Model` (a `implicit.meshes.Mesh`, a `implicit.laws.solid.Solid`, supports and
loads of `implicit.conditions`) and histories go into `implicit.solve.solve`; out comes an
`implicit.solution.Solution` with displacements, forces and an `implicit.outcome.Outcome`.
`implicit.sensitivity` differentiates it.
"""
