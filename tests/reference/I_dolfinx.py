"""Static compression of Yeoh, Ogden and Mooney-Rivlin cylinders by DOLFINx 0.5.2: one run, one file.

    python3 I_dolfinx.py yeoh 0.3 16 runs/yeoh_0.3_n16.npz    # specimen, friction or bonded, elements

The model is the axisymmetric upper half. It has Q2 displacement and a linear pressure, discontinuous between
elements (DPC 1). The energies are in UFL, which also computes their derivatives. The side touches the platen
at five Gauss points of every boundary element, the face at its nodes. Contact is a penalty on overclosure and
on slip with Coulomb's return mapping. On bonded faces the displacements are prescribed. Only the side can
then land, and it sticks. The program uses no code of the package. `I_tables.py` makes the tables.
"""

import sys

import numpy as np
import ufl
from dolfinx import fem, mesh
from I_specimens import POISSON, SPECIMENS, strains
from mpi4py import MPI
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu

PENALTY = 2000.0  # Contact's penalty over shear modulus and smallest element [-]
STEP, LEAST = 0.005, 2e-5  # largest and least step of compression [-]
GRADING = 4.0  # largest over smallest element; the small ones lie at side and face


def isochoric(name, constants, C, hoop, J):
    """The isochoric energy [kPa] of the right Cauchy-Green tensor in the plane and the hoop stretch."""
    third = J ** (-2.0 / 3.0)
    I1 = third * (ufl.tr(C) + hoop**2)
    if name.startswith("yeoh"):
        e = I1 - 3
        return constants["C10"] * e + constants["C20"] * e**2 + constants["C30"] * e**3
    if name == "neo_hookean":
        return constants["C10"] * (I1 - 3)
    if name == "reduced_polynomial":
        return constants["C10"] * (I1 - 3) + constants["C20"] * (I1 - 3) ** 2
    if name.startswith("mooney_rivlin"):
        I2 = third**2 * (ufl.det(C) + hoop**2 * ufl.tr(C))
        return constants["C10"] * (I1 - 3) + constants["C01"] * (I2 - 3)
    half, apart = ufl.tr(C) / 2, ufl.sqrt(((C[0, 0] - C[1, 1]) / 2) ** 2 + C[0, 1] ** 2 + 1e-12)
    squares = [third * (half + apart), third * (half - apart), third * hoop**2]
    return sum(
        2 * constants[f"mu{k}"] / constants[f"alpha{k}"] ** 2
        * (sum(b ** (constants[f"alpha{k}"] / 2) for b in squares) - 3)
        for k in (1, 2)
    )  # fmt: skip


def graded(length, n):
    """Corners of n elements whose sizes shrink geometrically towards the end."""
    size = GRADING ** (-np.arange(n) / (n - 1))
    return np.concatenate([[0.0], np.cumsum(size)]) * length / size.sum()


class Contact:
    """Face and side against the platen, by Gauss points of the boundary elements."""

    def __init__(self, nodes, lines, friction, stiffness):
        simpson = np.array([-1.0, 0.0, 1.0]), np.array([1.0, 4.0, 1.0]) / 3.0
        self.nodes, self.shape, area = [], [], []
        for line, (points, weights) in zip(
            lines, (np.polynomial.legendre.leggauss(5), simpson), strict=False
        ):
            N = np.stack([points * (points - 1) / 2, 1 - points**2, points * (points + 1) / 2], 1)
            for k in range(0, len(line) - 2, 2):
                three = line[k : k + 3]
                size = np.hypot(*(nodes[three[2]] - nodes[three[0]]))
                self.nodes += [three] * len(points)
                self.shape += list(N)
                area += list(weights * size / 2 * 2 * np.pi * (N @ nodes[three, 0]))
        self.nodes, self.shape = np.array(self.nodes), np.array(self.shape)
        self.k, self.friction = stiffness * np.array(area), friction
        start = self.at(nodes)
        self.touching = start[:, 1] >= nodes[:, 1].max() * (1 - 1e-9)
        self.anchor = start[:, 0]

    def at(self, x):
        """Places of the points, shape [n, 2]."""
        return np.einsum("pn,pni->pi", self.shape, x[self.nodes])

    def forces(self, x, level):
        """Forces on the points (r, z), their derivatives, shape [n, 2, 2], and which slip."""
        r, z = self.at(x).T
        down = self.k * np.maximum(z - level, 0.0)
        pressed = down > 0.0
        trial = np.where(pressed & self.touching, -self.k * (r - self.anchor), 0.0)
        limit = np.full(r.size, np.inf) if np.isinf(self.friction) else self.friction * down
        slips = np.abs(trial) > limit
        slope = np.sign(trial) * (0.0 if np.isinf(self.friction) else self.friction) * self.k
        across = np.where(slips, np.sign(trial) * np.where(slips, limit, 0.0), trial)
        by = np.zeros((r.size, 2, 2))
        by[:, 1, 1] = np.where(pressed, -self.k, 0.0)
        by[:, 0, 0] = np.where(pressed & self.touching & ~slips, -self.k, 0.0)
        by[:, 0, 1] = np.where(pressed & slips, slope, 0.0)
        return np.stack([across, -down], 1), by, slips

    def keep(self, x, level):
        """Remember an equilibrium: who touches, and where each is held."""
        force, _, slips = self.forces(x, level)
        r = self.at(x)[:, 0]
        pressed = force[:, 1] < 0.0
        moved = ~(pressed & self.touching) | slips
        self.anchor = np.where(moved, r + force[:, 0] / self.k, self.anchor)
        self.touching = pressed


class Cylinder:
    """The body, its equations and its contact."""

    def __init__(self, name, friction, n):
        diameter, length, mu, constants = SPECIMENS[name]
        self.radius, self.height, self.mu = diameter / 2, length / 2, mu
        self.bonded = friction == "bonded"
        m = max(4, round(n * self.height / self.radius))
        domain = mesh.create_rectangle(
            MPI.COMM_WORLD, [[0.0, 0.0], [1.0, 1.0]], [n, m], mesh.CellType.quadrilateral
        )
        r, z = graded(self.radius, n), graded(self.height, m)
        at = domain.geometry.x
        at[:, 0] = r[np.rint(at[:, 0] * n).astype(int)]
        at[:, 1] = z[np.rint(at[:, 1] * m).astype(int)]
        cell = domain.ufl_cell()
        W = fem.FunctionSpace(
            domain, ufl.MixedElement(ufl.VectorElement("Q", cell, 2), ufl.FiniteElement("DPC", cell, 1))
        )
        self.w = fem.Function(W)
        u, p = ufl.split(self.w)
        radius = ufl.SpatialCoordinate(domain)[0]
        F = ufl.Identity(2) + ufl.grad(u)
        hoop = 1 + u[0] / radius
        J = ufl.det(F) * hoop
        bulk = 2 * mu * (1 + POISSON) / (3 * (1 - 2 * POISSON))
        energy = isochoric(name, constants, F.T * F, hoop, J) + p * (J - 1) - p**2 / (2 * bulk)
        dx = ufl.dx(metadata={"quadrature_degree": 5})
        residual = ufl.derivative(2 * np.pi * radius * energy * dx, self.w, ufl.TestFunction(W))
        self.residual = fem.form(residual)
        self.jacobian = fem.form(ufl.derivative(residual, self.w, ufl.TrialFunction(W)))
        V, place = W.sub(0).collapse()
        self.nodes = V.tabulate_dof_coordinates()[:, :2].copy()
        self.dof = np.asarray(place).reshape(-1, 2)
        side = np.flatnonzero(self.nodes[:, 0] > self.radius * (1 - 1e-9))
        face = np.flatnonzero(self.nodes[:, 1] > self.height * (1 - 1e-9))
        self.side = side[np.argsort(self.nodes[side, 1])]
        face = face[np.argsort(self.nodes[face, 0])]
        self.middle = self.dof[self.nodes[:, 1] < 1e-9, 1]
        fixed = [self.dof[self.nodes[:, 0] < 1e-9, 0], self.middle]
        self.glued = self.dof[face, 1] if self.bonded else np.zeros(0, dtype=int)
        if self.bonded:
            fixed += [self.glued, self.dof[face, 0]]
        size = self.w.vector.getSize()
        self.free = np.setdiff1d(np.arange(size), np.concatenate(fixed))
        least = min(np.diff(r).min(), np.diff(z).min())
        lines = [self.side] if self.bonded else [self.side, face]
        self.contact = Contact(
            self.nodes, lines, np.inf if self.bonded else float(friction), PENALTY * mu / least
        )
        self.A = fem.petsc.create_matrix(self.jacobian)
        self.b = fem.petsc.create_vector(self.residual)

    def places(self, x):
        """Deformed places of the nodes [mm]."""
        return self.nodes + x[self.dof]

    def internal(self, x, tangent=True):
        """Internal forces [mN] and their derivatives."""
        self.w.x.array[:] = x
        with self.b.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self.b, self.residual)
        if not tangent:
            return self.b.array.copy(), None
        self.A.zeroEntries()
        fem.petsc.assemble_matrix(self.A, self.jacobian)
        self.A.assemble()
        start, column, value = self.A.getValuesCSR()
        return self.b.array.copy(), csr_matrix((value, column, start), shape=self.A.getSize())

    def newton(self, x, level):
        """Equilibrium near x, or None."""
        contact, before = self.contact, np.inf
        dof = self.dof[contact.nodes]
        for count in range(40):
            inside, K = self.internal(x)
            force, by, _ = contact.forces(self.places(x), level)
            outside = np.zeros(x.size)
            np.add.at(outside, dof, contact.shape[:, :, None] * force[:, None, :])
            rest = (inside - outside)[self.free]
            error = np.abs(rest).sum() / (np.abs(inside).sum() + np.abs(outside).sum())
            if not np.isfinite(error) or (error > 1e3 * before and error > 1.0):
                return None
            if error < 1e-9:
                return x
            before = error
            block = np.einsum("pa,pb,pij->paibj", contact.shape, contact.shape, by)
            rows = np.broadcast_to(dof[:, :, :, None, None], block.shape)
            columns = np.broadcast_to(dof[:, None, None, :, :], block.shape)
            K = K - coo_matrix((block.ravel(), (rows.ravel(), columns.ravel())), shape=K.shape)
            K = K.tocsr()[self.free][:, self.free].tocsc()
            x = x.copy()
            # Points that stick and slip in turn go round: later steps are shortened, by another share each.
            share = 1.0 if count < 10 else 0.2 + 0.8 * (0.618034 * count % 1.0)
            x[self.free] -= share * splu(K).solve(rest)
        return None


def main():
    """Compress and save force, radii and outline of every recorded strain."""
    name, friction, elements, out = sys.argv[1:5]
    largest = float(sys.argv[5]) if len(sys.argv) > 5 else STEP
    body = Cylinder(name, friction, int(elements))
    x = before = np.zeros(body.w.vector.getSize())
    done, size, last, rows, sides = 0.0, largest / 4, 0.0, [], []
    recorded = list(strains(name))
    while recorded:
        to = min(done + size, recorded[0])
        level = body.height * (1 - to)
        guesses = [x + (x - before) * (to - done) / last, x.copy()] if last else [x.copy()]
        if not last:
            # A little too long, so that the face presses.
            guesses[0][body.dof[:, 1]] -= body.nodes[:, 1] * to * (1.0 if body.bonded else 0.99)
            if body.bonded:
                guesses[0][body.dof[:, 0]] += body.nodes[:, 0] * to / 2
        found = None
        for guess in guesses:
            if body.bonded:
                guess[body.dof[body.nodes[:, 1] > body.height * (1 - 1e-9), 0]] = 0.0
                guess[body.glued] = -to * body.height
            found = body.newton(guess, level)
            if found is not None:
                break
        if found is None:
            size = (to - done) / 2
            if size < LEAST:
                print(f"no equilibrium at {to:.4f}", flush=True)
                break
            continue
        body.contact.keep(body.places(found), level)
        before, x, last, done = x, found, to - done, to
        size = min(largest, 1.5 * size)
        if abs(done - recorded[0]) < 1e-12:
            force = body.internal(x, tangent=False)[0][body.middle].sum()
            outline = body.places(x)[body.side]
            rows.append([done, 1e-3 * force, 1e-3 * outline[-1, 0], 1e-3 * outline[0, 0]])
            sides.append(1e-3 * outline)
            recorded.pop(0)
            print(*(f"{value:.6g}" for value in rows[-1]), flush=True)
            np.savez(out, history=np.array(rows), side=np.array(sides))


if __name__ == "__main__":
    main()
