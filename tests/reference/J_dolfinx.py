"""Force of the bonded strip of `benchmarks/equilibrium.py` by DOLFINx, as in its manual for hyperelasticity.

Usage: /usr/bin/python3 J_dolfinx.py 20x5x1 [--order 2] [--solver mumps] [--out J_strip.csv]

DOLFINx 0.5.2 (Debian 12, `python3-dolfinx`; not a dependency of this project). Neo-Hookean,
W = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2, mu = 25 kPa, nu = 0.45; 100 x 25 x 5 mm, both ends bonded, pulled
to 125 % in ten steps; three Gauss points a direction for order 2. Its last line is JSON: the forces, Newton's
iterations, and the processor seconds without compilation of the forms.
"""

import argparse
import json
import time

import numpy as np
import ufl
from dolfinx import fem, mesh, nls
from mpi4py import MPI
from petsc4py import PETSc

SIZE, SHEAR, POISSON, STRETCH, STEPS = (0.1, 0.025, 0.005), 25e3, 0.45, 1.25, 10


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cells")
    parser.add_argument("--order", type=int, default=2)
    parser.add_argument("--solver", default="mumps", help="mumps, or petsc for PETSc's own")
    parser.add_argument("--out")
    given = parser.parse_args()
    cells = [int(n) for n in given.cells.split("x")]
    body = mesh.create_box(MPI.COMM_WORLD, [[0.0, 0.0, 0.0], list(SIZE)], cells, mesh.CellType.hexahedron)
    space = fem.VectorFunctionSpace(body, ("CG", given.order))
    u, test = fem.Function(space), ufl.TestFunction(space)
    bulk = 2.0 * SHEAR * (1.0 + POISSON) / (3.0 * (1.0 - 2.0 * POISSON))
    F = ufl.variable(ufl.Identity(3) + ufl.grad(u))
    J = ufl.det(F)
    energy = SHEAR / 2.0 * (J ** (-2.0 / 3.0) * ufl.tr(F.T * F) - 3.0) + bulk / 2.0 * (J - 1.0) ** 2
    dx = ufl.Measure("dx", domain=body, metadata={"quadrature_degree": 2 * given.order + 1})
    residual = ufl.inner(ufl.grad(test), ufl.diff(energy, F)) * dx
    faces = [
        mesh.locate_entities_boundary(body, 2, lambda x, at=at: np.isclose(x[0], at)) for at in (0.0, SIZE[0])
    ]
    points = [fem.locate_dofs_topological(space, 2, face) for face in faces]
    pull = fem.Constant(body, np.zeros(3))
    held = [fem.dirichletbc(np.zeros(3), points[0], space), fem.dirichletbc(pull, points[1], space)]
    newton = nls.petsc.NewtonSolver(MPI.COMM_WORLD, fem.petsc.NonlinearProblem(residual, u, held))
    newton.rtol, newton.atol, newton.convergence_criterion = 1e-8, 1e-10, "residual"
    linear, options = newton.krylov_solver, PETSc.Options()
    prefix = linear.getOptionsPrefix()
    options[f"{prefix}ksp_type"], options[f"{prefix}pc_type"] = "preonly", "lu"
    options[f"{prefix}pc_factor_mat_solver_type"] = given.solver
    linear.setFromOptions()
    form = fem.form(residual)
    started, forces, iterations = time.process_time(), [], 0
    for step in range(1, STEPS + 1):
        pull.value[0] = SIZE[0] * STRETCH * step / STEPS
        count, converged = newton.solve(u)
        assert converged, f"step {step} did not converge"
        iterations += count
        inner = fem.petsc.assemble_vector(form).array.reshape(-1, 3)
        forces.append(float(inner[points[1], 0].sum()))
    seconds = time.process_time() - started
    if given.out:
        with open(given.out, "a", encoding="utf-8") as file:
            for step, force in enumerate(forces, start=1):
                file.write(f"{given.cells},{given.order},{STRETCH * step / STEPS:.6g},{force:.12g}\n")
    found = {"forces": forces, "iterations": iterations, "processor seconds": seconds, "peer": "DOLFINx"}
    print(json.dumps({**found, "displacements": 3 * space.dofmap.index_map.size_global}))


if __name__ == "__main__":
    main()
