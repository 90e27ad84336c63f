"""An impact test on a bonded, damped cylinder by DOLFINx 0.5.2: one experiment, one file.

    /usr/bin/python3 M_dolfinx.py experiment.json out.npz --elements 24 --step 0.5

The model is axisymmetric with finite strain. It has Q2 displacement and a linear pressure, discontinuous
between elements (DPC 1). Energy and damping stress are in UFL, which computes the tangent. The time
integration is the generalised alpha method of Chung and Hulbert. The motion of both faces is prescribed. A
node of the side that would pass through a platen in a step is fixed on it from the end of this step on. The
program uses no code of the package. Its input is the JSON file (in SI) of `python -m
populations.other_program`. Internal units: mm, ms, kPa, g/cm^3, mN.
"""

import argparse
import json
import time

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from petsc4py import PETSc  # noqa: F401  (before the assembly of PETSc's matrices)
from scipy.interpolate import PchipInterpolator
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu
from scipy.special import betainc

GRADING = 16.0  # largest over smallest element; the small ones lie at side and faces
RADIUS_AT_INFINITY = 0.9  # spectral radius of the generalised alpha method at infinite frequency [-]
SMALL = 1e-8  # largest increment of a displacement in the last iteration of a step [mm]
CLEAR = 0.47
"""Half the share of the length in which radii are read, clear of where the side folds onto a platen [-]."""
OFTEN = {"cffi_extra_compile_args": ["-O3", "-march=native", "-ffast-math"]}


def graded(length, n):
    """Corners of n elements whose sizes shrink geometrically towards the end."""
    size = GRADING ** (-np.arange(n) / (n - 1))
    return np.concatenate([[0.0], np.cumsum(size)]) * length / size.sum()


class Flyer:
    """The flyer's way and velocity: a rise by an incomplete beta function, then a drag by the way gone."""

    def __init__(self, given):
        self.v, self.rise = given["speed"], 1e3 * given["rise"]
        self.a, self.b = given["start_power"], given["end_power"]
        self.drag = given["drag"] / (1e3 * given["length"])

    def way(self, t):
        """Way gone at t [mm]; the integral of the regularised incomplete beta function in closed form."""
        s = min(max(t / self.rise, 0.0), 1.0)
        within = s * betainc(self.a, self.b, s) - self.a / (self.a + self.b) * betainc(self.a + 1, self.b, s)
        free = self.v * (self.rise * within + max(t - self.rise, 0.0))
        return -np.expm1(-self.drag * free) / self.drag if self.drag > 0.0 else free, free

    def motion(self, t):
        """Way, velocity and acceleration at t."""
        way, free = self.way(t)
        s, brake = min(max(t / self.rise, 0.0), 1.0), np.exp(-self.drag * free)
        risen = self.v * betainc(self.a, self.b, s)
        h = 1e-6
        beyond, before = (betainc(self.a, self.b, x) for x in (min(s + h, 1.0), max(s - h, 0.0)))
        slope = (beyond - before) / (2 * h)
        inside = 0.0 < t < self.rise
        growth = self.v * slope / self.rise if inside else 0.0
        return way, risen * brake, (growth - self.drag * risen**2) * brake


class Cylinder:
    """The body and its equations."""

    def __init__(self, given, n, m):
        self.radius, self.height = 0.5e3 * given["diameter"], 1e3 * given["length"]
        domain = mesh.create_rectangle(
            MPI.COMM_WORLD, [[0.0, 0.0], [1.0, 1.0]], [n, 2 * m], mesh.CellType.quadrilateral
        )
        half = 0.5 * self.height - graded(0.5 * self.height, m)[::-1]
        r, y = graded(self.radius, n), np.concatenate([half, self.height - half[-2::-1]])
        at = domain.geometry.x
        at[:, 0] = r[np.rint(at[:, 0] * n).astype(int)]
        at[:, 1] = y[np.rint(at[:, 1] * 2 * m).astype(int)]
        cell = domain.ufl_cell()
        W = fem.FunctionSpace(
            domain, ufl.MixedElement(ufl.VectorElement("Q", cell, 2), ufl.FiniteElement("DPC", cell, 1))
        )
        V, place = W.sub(0).collapse()
        self.w, self.rest = fem.Function(W), fem.Function(V)
        self.rate = fem.Constant(domain, 1.0)
        self._forms(given, domain, W, V)
        self.nodes = V.tabulate_dof_coordinates()[:, :2].copy()
        self.dof = np.asarray(place).reshape(-1, 2)
        self.size = self.w.vector.getSize()
        tiny = 1e-9 * self.radius
        side = np.flatnonzero(self.nodes[:, 0] > self.radius - tiny)
        self.side = side[np.argsort(self.nodes[side, 1])]
        self.bottom = np.flatnonzero(self.nodes[:, 1] < tiny)
        self.top = np.flatnonzero(self.nodes[:, 1] > self.height - tiny)
        self.axis = np.flatnonzero(self.nodes[:, 0] < tiny)

    def _forms(self, given, domain, W, V):
        mu0, m, nu = 1e-3 * given["shear_modulus"], given["stiffness_factor"], given["poisson"]
        bulk = 2 * mu0 * (1 + nu) / (3 * (1 - 2 * nu))
        u, p = ufl.split(self.w)
        du, _ = ufl.TestFunctions(W)
        radius = ufl.SpatialCoordinate(domain)[0]
        F, hoop = ufl.Identity(2) + ufl.grad(u), 1 + u[0] / radius
        J = ufl.det(F) * hoop
        e = J ** (-2.0 / 3.0) * (ufl.inner(F, F) + hoop**2) - 3
        isochoric = mu0 / 2 * (e + given["second"] * e**2 / 2 + given["third"] * e**3 / 3)
        energy = m * isochoric + p * (J - 1) - p**2 / (2 * m * bulk)
        # sigma_d = 2 beta m mu0 dev D, its power by the velocity gradient of the test function.
        v = self.rate * u + self.rest
        inverse = ufl.inv(F)
        D, Dt = ufl.sym(ufl.grad(v) * inverse), v[0] / (radius + u[0])
        E, Et = ufl.sym(ufl.grad(du) * inverse), du[0] / (radius + u[0])
        third = (ufl.tr(D) + Dt) / 3
        viscous = 2 * (1e3 * given["damping"]) * m * mu0
        power = viscous * J * (ufl.inner(D, E) + Dt * Et - third * (ufl.tr(E) + Et))
        dx = ufl.dx(metadata={"quadrature_degree": 5})
        turn = 2 * np.pi * radius
        residual = ufl.derivative(turn * energy * dx, self.w, ufl.TestFunction(W)) + turn * power * dx
        self.residual = fem.form(residual, jit_params=OFTEN)
        self.jacobian = fem.form(ufl.derivative(residual, self.w, ufl.TrialFunction(W)), jit_params=OFTEN)
        test, trial = ufl.TestFunction(V), ufl.TrialFunction(V)
        density = 1e-3 * given["density"]
        mass = fem.petsc.assemble_matrix(fem.form(turn * density * ufl.inner(test, trial) * dx))
        mass.assemble()
        start, column, value = mass.getValuesCSR()
        self.mass = csr_matrix((value, column, start), shape=mass.getSize())
        self.A = fem.petsc.create_matrix(self.jacobian)
        self.b = fem.petsc.create_vector(self.residual)

    def internal(self, w):
        """Elastic and damping forces."""
        self.w.x.array[:] = w
        with self.b.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self.b, self.residual)
        return self.b.array.copy()

    def tangent(self, w):
        """Their derivative."""
        self.w.x.array[:] = w
        self.A.zeroEntries()
        fem.petsc.assemble_matrix(self.A, self.jacobian)
        self.A.assemble()
        start, column, value = self.A.getValuesCSR()
        return csr_matrix((value, column, start), shape=self.A.getSize())


class Test:
    """The body in time."""

    def __init__(self, given, elements, step):
        self.body = Cylinder(given, *elements)
        self.flyer = Flyer(given)
        n = self.body.nodes.size
        self.u, self.v, self.a, self.p = np.zeros(n), np.zeros(n), np.zeros(n), None
        rho = RADIUS_AT_INFINITY
        self.am, self.af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        self.gamma = 0.5 - self.am + self.af
        self.beta = 0.25 * (1 - self.am + self.af) ** 2
        self.dt, self.t = step, 0.0
        self.flat = self.body.dof.ravel()
        """Unknown of each component of each node."""
        self.low, self.high = set(self.body.bottom.tolist()), set(self.body.top.tolist())
        self.lu, self.w, self.before = None, np.zeros(self.body.size), None
        self.count = {"factorisations": 0, "iterations": 0, "landed": 0}
        """Nodes on either platen."""

    def step(self):
        """One step; the force on the transmission platen and the time it belongs to."""
        fresh = []
        while True:
            state = self._solve(fresh)
            u = state[0].reshape(-1, 2)
            y = self.body.nodes[:, 1] + u[:, 1]
            level = self.body.height - self.flyer.way(self.t + self.dt)[0]
            held = self.low | self.high | {node for node, _, _ in fresh}
            more = [(int(k), 0, u[k, 0]) for k in self.body.side if y[k] < 0.0 and int(k) not in held]
            more += [(int(k), 1, u[k, 0]) for k in self.body.side if y[k] > level and int(k) not in held]
            if not more:
                break
            fresh, self.lu = fresh + more, None
        self.u, self.v, self.a, w, force = state
        self.before, self.w = self.w, w
        for node, upper, _ in fresh:
            (self.high if upper else self.low).add(node)
            _, v, a = self.flyer.motion(self.t + self.dt)
            self.v[2 * node : 2 * node + 2] = 0.0, -v * upper
            self.a[2 * node : 2 * node + 2] = 0.0, -a * upper
        if fresh:
            self.lu, self.before = None, None
        self.count["landed"] += len(fresh)
        at = self.t + (1 - self.af) * self.dt
        self.t += self.dt
        return at, force

    def _held(self, fresh):
        """Components that are held, with their displacement, velocity and acceleration at the step's end."""
        way, v, a = self.flyer.motion(self.t + self.dt)
        y = self.body.nodes[:, 1]
        low, high = np.array(sorted(self.low)), np.array(sorted(self.high))
        parts = [
            (2 * self.body.axis, 0.0, 0.0, 0.0),
            (2 * low, self.u[2 * low], 0.0, 0.0),
            (2 * high, self.u[2 * high], 0.0, 0.0),
            (2 * low + 1, -y[low], 0.0, 0.0),
            (2 * high + 1, self.body.height - way - y[high], -v, -a),
        ]
        for node, upper, across in fresh:
            along = (self.body.height - way if upper else 0.0) - y[node]
            k = 2 * node
            at = [(across, k), (along, k + 1)]
            for value, i in at:
                a_end = (value - self.u[i] - self.dt * self.v[i]) / (self.beta * self.dt**2)
                a_end -= (0.5 / self.beta - 1) * self.a[i]
                v_end = self.v[i] + self.dt * ((1 - self.gamma) * self.a[i] + self.gamma * a_end)
                parts.append((np.array([i]), value, v_end, a_end))
        columns = [np.broadcast_to(np.asarray(c, float), (len(i),)) for i, *cs in parts for c in cs]
        index = np.concatenate([i for i, *_ in parts])
        whole = [np.concatenate(columns[j::3]) for j in range(3)]
        _, first = np.unique(index, return_index=True)
        return index[first], *(w[first] for w in whole)

    def _solve(self, fresh):
        """Displacement, velocity and acceleration at the step's end and the force on the platen [N]."""
        dt, am, af, body = self.dt, self.am, self.af, self.body
        held, u_held, v_held, a_held = self._held(fresh)
        # Rates at the step's inner point are these factors times the displacement there, plus the rest.
        c2, c1 = (1 - am) / ((1 - af) * self.beta * dt**2), self.gamma / (self.beta * dt)
        v, a = self._rates(-self.u / (1 - af))
        v_rest, a_rest = (1 - af) * v + af * self.v, (1 - am) * a + am * self.a
        inner = (1 - af) * u_held + af * self.u[held]
        v_rest[held] = (1 - af) * v_held + af * self.v[held] - c1 * inner
        a_rest[held] = (1 - am) * a_held + am * self.a[held] - c2 * inner
        body.rate.value, body.rest.x.array[:] = c1, v_rest
        w = self.w.copy() if self.before is None else 2 * self.w - self.before
        ahead = self.u + (1 - af) * (dt * self.v + 0.5 * dt**2 * self.a)
        ahead[held] = inner
        w[self.flat] = ahead
        free = np.setdiff1d(np.arange(body.size), self.flat[held])
        moving = np.isin(free, self.flat)

        def residual():
            r = body.internal(w)
            r[self.flat] += body.mass @ (c2 * w[self.flat] + a_rest)
            return r

        for count in range(40):
            r = residual()[free]
            if self.lu is None or count % 8 == 7:
                self.lu = self._factors(w, c2, free)
            change = self.lu.solve(r)
            w[free] -= change
            self.count["iterations"] += 1
            largest = np.abs(change[moving]).max()
            if not largest < 1.0:
                raise RuntimeError(f"no equilibrium at {self.t:.6f} ms")
            if largest < SMALL:
                break
        else:
            raise RuntimeError(f"no convergence at {self.t:.6f} ms: {largest:.3g} mm")
        if count > 3:
            self.lu = None
        pressed = self.low | {node for node, upper, _ in fresh if not upper}
        force = 1e-3 * residual()[self.flat[2 * np.array(sorted(pressed)) + 1]].sum()
        change = (w[self.flat] - self.u) / (1 - af)
        u, (v, a) = self.u + change, self._rates(change)
        u[held], v[held], a[held] = u_held, v_held, a_held
        return u, v, a, w, force

    def _rates(self, change):
        """Newmark's velocity and acceleration at the step's end after a change of displacement."""
        a = (change - self.dt * self.v) / (self.beta * self.dt**2) - (0.5 / self.beta - 1) * self.a
        return self.v + self.dt * ((1 - self.gamma) * self.a + self.gamma * a), a

    def _factors(self, w, inertia, free):
        """Triangular factors of the tangent."""
        K, M = self.body.tangent(w), self.body.mass.tocoo()
        place = self.flat[M.row], self.flat[M.col]
        whole = K + csr_matrix((inertia * M.data, place), shape=K.shape)
        self.count["factorisations"] += 1
        return splu(whole[free][:, free].tocsc())


def outline(body, u):
    """Points of the side, eight an element, of the element's own quadratic; shape [n, 2]."""
    x = (body.nodes + u.reshape(-1, 2))[body.side]
    s = np.linspace(-1.0, 1.0, 8, endpoint=False)
    N = np.stack([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2])
    three = np.stack([x[0:-2:2], x[1:-1:2], x[2::2]])
    return np.concatenate([np.einsum("ks,kei->esi", N, three).reshape(-1, 2), x[-1:]])


def main():
    """Run the test and save force and radii where and when the file asks for them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("experiment")
    parser.add_argument("out")
    parser.add_argument("--elements", type=int, nargs=2, default=(24, 16), help="radius, half length")
    parser.add_argument("--step", type=float, default=0.5, help="us")
    given = parser.parse_args()
    with open(given.experiment, encoding="utf-8") as file:
        asked = json.load(file)
    started = time.process_time()
    test = Test(asked, given.elements, 1e-3 * given.step)
    body, frames = test.body, 1e3 * np.array(asked["frames"])
    heights, samples = np.array(asked["heights"]), 1e3 * np.array(asked["samples"])
    times, forces, Z, seen = [0.0], [0.0], [], outline(body, test.u)
    prepared = time.process_time() - started
    while len(Z) < len(frames) or times[-1] < samples[-1]:
        began = test.t
        at, force = test.step()
        times.append(at)
        forces.append(force)
        now = outline(body, test.u)
        while len(Z) < len(frames) and frames[len(Z)] <= test.t:
            share = (frames[len(Z)] - began) / test.dt
            r, y = ((1 - share) * seen + share * now).T
            level = body.height - test.flyer.way(frames[len(Z)])[0]
            within = np.abs(y / level - 0.5) < CLEAR
            Z.append(PchipInterpolator(y[within], r[within])(heights * level))
        seen = now
    said = {"prepared": prepared, "seconds": time.process_time() - started, **test.count}
    print(json.dumps(said), flush=True)
    force, radii = np.interp(samples, times, forces), 1e-3 * np.array(Z).ravel()
    np.savez_compressed(given.out, force=force, Z=radii, said=json.dumps(said))


if __name__ == "__main__":
    main()
