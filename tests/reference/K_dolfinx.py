"""Bend of the actuator of `runs/actuator/pneunet.toml` by DOLFINx, on the same tetrahedra.

Usage: python runs/actuator/mesh_of.py runs/actuator/pneunet.toml MESH.npz
       /usr/bin/python3 K_dolfinx.py MESH.npz [--degree 2] --out K_pneunet.csv

DOLFINx 0.5.2 (Debian 12, `python3-dolfinx`; not a dependency of this project). Quadratic tetrahedra,
W = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2, weight, and the pressure p on the deformed walls of the cavity,
p int J F^-T N . v dS, whose derivative UFL takes. --degree is that of the quadrature, in the body and on
faces; 2 are the points of `kolsky.equilibrium`.
"""

import argparse

import numpy as np
import ufl
from dolfinx import fem, mesh, nls
from mpi4py import MPI
from petsc4py import PETSc
from scipy.spatial import cKDTree

STEP = 5e3  # largest step of the pressure [Pa]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("mesh")
    parser.add_argument("--degree", type=int, default=4)
    parser.add_argument("--out", required=True)
    given = parser.parse_args()
    data = np.load(given.mesh)
    shear, bulk, density = (float(x) for x in data["material"])
    used, cells = np.unique(data["cells"], return_inverse=True)
    cell = ufl.Cell("tetrahedron", geometric_dimension=3)
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
    body = mesh.create_mesh(
        MPI.COMM_WORLD, cells.reshape(-1, 4).astype(np.int64), data["points"][used], domain
    )
    size = np.ptp(data["points"][:, 0])
    space = fem.VectorFunctionSpace(body, ("CG", 2))
    u, test = fem.Function(space), ufl.TestFunction(space)
    F = ufl.variable(ufl.Identity(3) + ufl.grad(u))
    J = ufl.det(F)
    energy = shear / 2.0 * (J ** (-2.0 / 3.0) * ufl.tr(F.T * F) - 3.0) + bulk / 2.0 * (J - 1.0) ** 2
    body.topology.create_connectivity(2, 3)
    body.topology.create_connectivity(2, 0)
    outer = mesh.exterior_facet_indices(body.topology)
    middles = mesh.compute_midpoints(body, 2, outer)
    distance, _ = cKDTree(data["cavity"]).query(middles)
    pressed = np.sort(outer[distance < 1e-9])
    assert len(pressed) == len(data["cavity"]), "not every face of the cavity was found"
    tags = mesh.meshtags(body, 2, pressed, np.full(len(pressed), 1, dtype=np.int32))
    rule = {"quadrature_degree": given.degree}
    dx = ufl.Measure("dx", domain=body, metadata=rule)
    ds = ufl.Measure("ds", domain=body, subdomain_data=tags, metadata=rule)
    p, g = fem.Constant(body, 0.0), fem.Constant(body, np.zeros(3))
    follower = p * ufl.dot(J * ufl.inv(F).T * ufl.FacetNormal(body), test) * ds(1)
    residual = (
        ufl.inner(ufl.grad(test), ufl.diff(energy, F)) * dx + follower - density * ufl.dot(g, test) * dx
    )
    clamped = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[0], 0.0, atol=1e-9 * size))
    held = [fem.dirichletbc(np.zeros(3), clamped, space)]
    if data["half"]:
        part, _ = space.sub(1).collapse()
        on = fem.locate_dofs_geometrical(
            (space.sub(1), part), lambda x: np.isclose(x[1], 0.0, atol=1e-9 * size)
        )
        held.append(fem.dirichletbc(fem.Function(part), on, space.sub(1)))
    newton = nls.petsc.NewtonSolver(MPI.COMM_WORLD, fem.petsc.NonlinearProblem(residual, u, held))
    newton.rtol, newton.atol, newton.convergence_criterion = 1e-9, 1e-12, "residual"
    linear, options = newton.krylov_solver, PETSc.Options()
    prefix = linear.getOptionsPrefix()
    options[f"{prefix}ksp_type"], options[f"{prefix}pc_type"] = "preonly", "lu"
    options[f"{prefix}pc_factor_mat_solver_type"] = "mumps"
    linear.setFromOptions()
    places = space.tabulate_dof_coordinates()
    _, at = cKDTree(places).query(data["line"])
    with open(given.out, "w", encoding="utf-8") as file:
        file.write("gravity,pressure (Pa),node,rest x (m),x (m),y (m),z (m)\n")
        for name, acceleration in zip(data["names"], data["gravities"], strict=True):
            u.x.array[:] = 0.0
            p.value = 0.0
            for share in (0.25, 0.5, 0.75, 1.0):
                g.value[:] = share * acceleration
                assert newton.solve(u)[1], "the weight did not converge"
            for wanted in [0.0, *data["pressures"]]:
                steps = max(1, int(np.ceil((wanted - float(p.value)) / STEP - 1e-9)))
                for value in np.linspace(float(p.value), wanted, steps + 1)[1:]:
                    p.value = value
                    assert newton.solve(u)[1], f"{value} Pa did not converge"
                moved = data["line"] + u.x.array.reshape(-1, 3)[at]
                for node, rest, (x, y, z) in zip(data["line_nodes"], data["line"][:, 0], moved, strict=True):
                    file.write(f"{name},{wanted:g},{node},{rest:.12g},{x:.12g},{y:.12g},{z:.12g}\n")
                file.flush()


if __name__ == "__main__":
    main()
