"""Cook's membrane by DOLFINx: nearly incompressible, plane strain, quadratic displacements, linear pressure.

Usage: /usr/bin/python3 L_dolfinx.py [--cells 8 16 32 64] [--out L_cook.csv]

DOLFINx 0.5.2 (Debian 12, `python3-dolfinx`; not a dependency of this project). The triangles of Taylor and
Hood with a continuous pressure, another formulation than the elements compared with it: the stationary point
of mu/2 (J^(-2/3) tr C - 3) + p (J - 1) - p^2 / (2 K) less the work of the load; mu = 80.1938 N/mm2, K = 5000
mu, 100 N on the right edge of a thickness of 1 mm (Simo and Armero 1992, Section 4.2), in four steps.
"""

import argparse

import numpy as np
import ufl
from dolfinx import fem, mesh, nls
from mpi4py import MPI
from petsc4py import PETSc

SHEAR, RATIO, LOAD, STEPS = 80.1938, 5000.0, 100.0 / 16.0, 4


def rise(cells: int) -> float:
    """Rise of the upper right corner [mm]."""
    body = mesh.create_unit_square(MPI.COMM_WORLD, cells, cells)
    x, y = body.geometry.x[:, 0].copy(), body.geometry.x[:, 1].copy()
    body.geometry.x[:, 0] = 48.0 * x
    body.geometry.x[:, 1] = 44.0 * x + (44.0 - 28.0 * x) * y
    displacement = ufl.VectorElement("CG", body.ufl_cell(), 2)
    pressure = ufl.FiniteElement("CG", body.ufl_cell(), 1)
    space = fem.FunctionSpace(body, ufl.MixedElement([displacement, pressure]))
    state, test = fem.Function(space), ufl.TestFunction(space)
    u, p = ufl.split(state)
    F = ufl.Identity(2) + ufl.grad(u)
    J = ufl.det(F)
    energy = SHEAR / 2.0 * (J ** (-2.0 / 3.0) * (ufl.tr(F.T * F) + 1.0) - 3.0)
    energy += p * (J - 1.0) - p**2 / (2.0 * RATIO * SHEAR)
    right = mesh.locate_entities_boundary(body, 1, lambda x: np.isclose(x[0], 48.0))
    tags = mesh.meshtags(body, 1, np.sort(right), np.ones(len(right), dtype=np.int32))
    ds = ufl.Measure("ds", domain=body, subdomain_data=tags)
    load = fem.Constant(body, PETSc.ScalarType(0.0))
    total = energy * ufl.Measure("dx", domain=body, metadata={"quadrature_degree": 6}) - load * u[1] * ds(1)
    residual = ufl.derivative(total, state, test)
    left = mesh.locate_entities_boundary(body, 1, lambda x: np.isclose(x[0], 0.0))
    part, _ = space.sub(0).collapse()
    dofs = fem.locate_dofs_topological((space.sub(0), part), 1, left)
    held = fem.dirichletbc(fem.Function(part), dofs, space.sub(0))
    newton = nls.petsc.NewtonSolver(MPI.COMM_WORLD, fem.petsc.NonlinearProblem(residual, state, [held]))
    newton.rtol, newton.atol, newton.convergence_criterion = 1e-9, 1e-10, "residual"
    linear, options = newton.krylov_solver, PETSc.Options()
    prefix = linear.getOptionsPrefix()
    options[f"{prefix}ksp_type"], options[f"{prefix}pc_type"] = "preonly", "lu"
    options[f"{prefix}pc_factor_mat_solver_type"] = "mumps"
    linear.setFromOptions()
    for step in range(1, STEPS + 1):
        load.value = LOAD * step / STEPS
        _count, converged = newton.solve(state)
        assert converged
    found = state.sub(0).collapse()
    places = found.function_space.tabulate_dof_coordinates()
    corner = int(np.argmax(places[:, 0] + places[:, 1]))
    return float(found.x.array.reshape(-1, 2)[corner, 1])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cells", type=int, nargs="+", default=[8, 16, 32, 64])
    parser.add_argument("--out")
    given = parser.parse_args()
    lines = ["# DOLFINx 0.5.2, triangles of Taylor and Hood: cells along an edge, rise of the corner [mm]"]
    for cells in given.cells:
        lines.append(f"{cells},{rise(cells):.8g}")
        print(lines[-1], flush=True)
    if given.out:
        with open(given.out, "w", encoding="utf-8") as file:
            file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
