"""Static compression of a soft cylinder between rigid platens with Coulomb friction, in GetFEM 5.4.2.

    python3 friction_getfem.py --friction 0.2 --elements 48 --grading 4 --out run.npz

The model is the upper half of the cylinder: axisymmetric rectangles of Q2 displacement and continuous Q1
pressure (`--pure`: displacement only). Face and side can touch the platen at each of their nodes. Simpson's
rule integrates the contact terms, so every node has a separate force. GetFEM's projection for Coulomb's law
(augmented Lagrangian) satisfies the law exactly. Newton steps are full; slip is counted from one load step to
the next. Sometimes no static solution is near the last one, because a node of the side lands and snaps. The
body then creeps to rest under a viscous drag at constant compression, and the run reports this. Internal
units are mm, kPa and mN; the file has SI units.
"""

import argparse
import sys

import getfem as gf
import numpy as np

RADIUS, HALF = 4.75, 3.25  # mm
YOUNG, POISSON = 80.0, 0.495  # kPa
CONTACT, AXIS, MIDDLE = 1, 2, 3
ISOCHORIC = "mu/2*(I1-3)"  # energy of the isochoric invariants [kPa]; `H_getfem.py` puts others here
SMALL = 1e-5  # sum of all nodal imbalances [mN] at which a step has converged


def graded(n, grading):
    """Places from 0 to 1 whose distances fall geometrically by `grading`."""
    edges = np.concatenate([[0.0], np.cumsum(grading ** (-np.linspace(0.0, 1.0, n)))])
    return edges / edges[-1]


class Cylinder:
    """The finite-element model."""

    def __init__(self, friction, elements, grading, pure, augmentation):
        mesh = gf.Mesh(
            "cartesian", RADIUS * graded(elements, grading), HALF * graded(round(elements * 11 / 16), grading)
        )
        faces = mesh.outer_faces()
        normal = mesh.normal_of_faces(faces)
        mesh.set_region(CONTACT, faces[:, (normal[1] > 0.9) | (normal[0] > 0.9)])
        mesh.set_region(AXIS, faces[:, normal[0] < -0.9])
        mesh.set_region(MIDDLE, faces[:, normal[1] < -0.9])
        fem_u, fem_p = gf.MeshFem(mesh, 2), gf.MeshFem(mesh, 1)
        fem_u.set_fem(gf.Fem("FEM_QK(2,2)"))
        fem_p.set_fem(gf.Fem("FEM_QK(2,1)"))
        gauss = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(2,6)"))
        self.gauss, self.fem = gauss, fem_u
        self.nodal = gf.MeshIm(mesh, gf.Integ("IM_NC_PARALLELEPIPED(2,2)"))
        md = self.md = gf.Model("real")
        md.add_fem_variable("u", fem_u)
        md.add_filtered_fem_variable("l", fem_u, CONTACT)  # force on the body per reference area
        constants = {
            "mu": YOUNG / (2 * (1 + POISSON)), "K": YOUNG / (3 * (1 - 2 * POISSON)), "f": friction,
            "a": augmentation, "h": HALF, "drag": 0.0,
        }  # fmt: skip
        for name, value in constants.items():
            md.add_initialized_data(name, value)
        md.add_initialized_fem_data("u0", fem_u, np.zeros(fem_u.nbdof()))
        grad, hoop = "(Id(2)+Grad_u)", "(1+u(1)/X(1))"
        jac = f"(Det{grad}*{hoop})"
        plane = f"Norm_sqr{grad}"
        half = f"sqrt(sqr({plane}/2)-sqr(Det{grad})+1e-12)"
        shear = ISOCHORIC
        for name, meant in (
            ("I1", f"(pow({jac},-2/3)*({plane}+sqr{hoop}))"),
            ("I2", f"(pow({jac},-4/3)*(sqr(Det{grad})+{plane}*sqr{hoop}))"),
            ("B1", f"(pow({jac},-2/3)*({plane}/2+{half}))"),  # squares of the isochoric stretches
            ("B2", f"(pow({jac},-2/3)*({plane}/2-{half}))"),
            ("B3", f"(pow({jac},-2/3)*sqr{hoop})"),
        ):
            shear = shear.replace(name, meant)
        shear = f"({shear})"
        bulk = f"K/2*sqr({jac}-1)"
        if not pure:
            md.add_fem_variable("p", fem_p)
            bulk = f"(p*({jac}-1)-p*p/(2*K))"
        md.add_nonlinear_term(gauss, f"2*pi*X(1)*({shear}+{bulk})")
        md.add_nonlinear_term(gauss, "2*pi*X(1)*drag*(u-u0).Test_u", -1, False, False)
        law = "Coulomb_friction_coupled_projection(l,[0;1],[u(1)-u0(1);0],h-X(2)-u(2),f,a)"
        # A ring at the axis has no area, so it has no force either.
        md.add_nonlinear_term(
            self.nodal,
            f"-2*pi*X(1)*l.Test_u+1/a*(l-Heaviside(X(1)-1e-6)*{law}).Test_l",
            CONTACT,
            False,
            False,
        )
        for region, fixed in ((AXIS, [1.0, 0.0]), (MIDDLE, [0.0, 1.0])):
            md.add_initialized_data(f"H{region}", np.diag(fixed))
            md.add_initialized_data(f"zero{region}", [0.0, 0.0])
            md.add_generalized_Dirichlet_condition_with_penalization(
                gauss, "u", 1e8, region, f"zero{region}", f"H{region}"
            )
        first, count = md.interval_of_variable("u")
        self.of_u = np.arange(first, first + count)
        self.place = fem_u.basic_dof_nodes()[:, 0::2]
        on_face = self.place[1] > HALF - 1e-9
        on_side = self.place[0] > RADIUS - 1e-9
        self.face = np.flatnonzero(on_face)[np.argsort(self.place[0, on_face])]
        self.side = np.flatnonzero(on_side)[np.argsort(self.place[1, on_side])]
        self.random = np.random.default_rng(0)  # shortens steps that would go round in circles

    def newton(self, guess, compression, drag, before, most=24):
        """One load step; whether it converged, and the solution."""
        md, x = self.md, guess
        md.set_variable("h", [HALF * (1.0 - compression)])
        md.set_variable("u0", before)
        md.set_variable("drag", [drag])
        for iteration in range(most):
            share = 1.0 if iteration < 9 else 0.3 + 0.7 * self.random.random()
            md.to_variables(x)
            md.assembly("build_all")
            residual = md.rhs()
            size = np.abs(residual).sum()
            if not np.isfinite(size):
                return False, x
            if size < SMALL:
                return True, x
            step = np.asarray(gf.linsolve_mumps(md.tangent_matrix(), residual)).ravel()
            x = x + min(share, 0.3 / np.abs(step[self.of_u]).max()) * step
        return False, x

    def creep(self, state, before, compression, least=0.5):
        """Overdamped motion to rest at constant compression."""
        drag, failures = 100.0, 0
        while failures < 60:
            ok, x = self.newton(state.copy(), compression, drag, before)
            if ok:
                state = x
                self.md.to_variables(state)
                before = self.md.variable("u").copy()
                if drag == 0.0:
                    return state
                drag = drag / 2 if drag > least else 0.0
            else:
                drag, failures = max(4 * drag, 4 * least), failures + 1
        sys.exit(f"no solution at {compression}")

    def observe(self):
        """Force [N], radii of corner, contact and middle [m]."""
        force = -1e-3 * gf.asm_generic(self.nodal, 0, "2*pi*X(1)*l(2)", CONTACT, self.md)
        u = self.md.variable("u")
        r, z = self.place[0] + u[0::2], self.place[1] + u[1::2]
        h = self.md.variable("h")[0]
        edge = np.concatenate([self.face, self.side])
        touching = edge[z[edge] > h - 1e-7]
        outer = r[touching].max()
        return force, 1e-3 * r[self.side[-1]], 1e-3 * outer, 1e-3 * r[self.side[0]]

    def boundary(self):
        """Positions (r, z) of the nodes of face and side [m]."""
        u = self.md.variable("u")
        now = 1e-3 * (self.place + np.stack([u[0::2], u[1::2]]))
        return now[:, self.face].T, now[:, self.side].T


def main():
    """Compress to 60 % and save every step's force and the boundary at each tenth."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--friction", type=float, required=True)
    parser.add_argument("--elements", type=int, default=32)
    parser.add_argument("--grading", type=float, default=1.0)
    parser.add_argument("--step", type=float, default=0.0025)
    parser.add_argument("--pure", action="store_true")
    parser.add_argument("--augmentation", type=float, default=400.0)
    parser.add_argument("--end", type=float, default=0.6)
    parser.add_argument("--static", action="store_true", help="stop rather than creep")
    parser.add_argument("--out", required=True)
    a = parser.parse_args()
    gf.util("trace level", 0)
    gf.util("warning level", 0)
    body = Cylinder(a.friction, a.elements, a.grading, a.pure, a.augmentation)
    state = body.md.from_variables().copy()
    before = body.md.variable("u").copy()
    done, size, slope, target = 0.0, a.step, None, 0.1
    history, faces, sides, snaps = [], [], [], []
    while done < a.end - 1e-9:
        size = min(size, target - done)
        to, ok = done + size, False
        if slope is not None:
            ok, x = body.newton(state + size * slope, to, 0.0, before)
        if not ok:
            ok, x = body.newton(state.copy(), to, 0.0, before)
        if not ok and size > a.step / 50:
            size /= 2
            continue
        if not ok and a.static:
            sys.exit(f"no static solution near the last one at {to}")
        if not ok:
            x = body.creep(state.copy(), before, to)
            snaps.append(to)
        body.md.to_variables(x)
        slope = (x - state) / size if ok else None
        state, done, before = x, to, body.md.variable("u").copy()
        history.append([done, *body.observe()])
        size = min(a.step, 1.5 * size)
        if abs(done - target) < 1e-9:
            face, side = body.boundary()
            faces.append(face)
            sides.append(side)
            print(f"{done:.1f}", *(f"{v:.6g}" for v in history[-1][1:]), len(snaps), flush=True)
            target += 0.1
    np.savez(
        a.out, history=np.array(history), face=np.array(faces), side=np.array(sides),
        face_r0=1e-3 * body.place[0, body.face], side_z0=1e-3 * body.place[1, body.side],
        snaps=np.array(snaps),
    )  # fmt: skip


if __name__ == "__main__":
    main()
