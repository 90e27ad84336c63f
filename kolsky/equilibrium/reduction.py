"""A reduced model: u = V q with few unknowns.

Forces come from few weighted elements; loads are exact.

The basis V has the smallest residual of the snapshots U = [u_1 .. u_n] (Sirovich 1987),

    sum_j |u_j - V V^T u_j|^2 = sum_{k > r} s_k^2.                                             (R.1)

The elements contribute g_e = V_e^T f_e to the reduced forces of training states. These contributions are the
columns of G, and their sum is b = G 1. The weights w >= 0, most of them zero, satisfy

    |G w - b| <= tau |b|                                                                       (R.2)

(energy-conserving sampling and weighting; Farhat, Avery, Chapman and Cortial 2014). They are found by Lawson
and Hanson's active set. The equilibrium follows from Newton's method with the exact tangent of

    sum_e w_e V_e^T f_e(V q, c) = sum_k p_k (a_k + B_k q + 1/2 q^T C_k q) + lam V^T f_g          (R.3)

A follower pressure on the faces of Lagrange elements is a polynomial of second degree in the positions.
Therefore a, B and C are computed once and are valid for every q.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray, IntArray
from kolsky.equilibrium.equations import Equations
from kolsky.equilibrium.meshes import Mesh, components
from kolsky.equilibrium.model import (
    Coupled,
    Gravity,
    Model,
    NodalForce,
    Prescribed,
    Pressure,
    RigidSurface,
    SelfContact,
    Traction,
)
from kolsky.equilibrium.points import Points
from kolsky.equilibrium.solution import Outcome

SMALLEST = 1e-14
"""Square of the smallest used singular value, as a share of the square of the largest [-]."""


def decompose(snapshots: FloatArray, most: int) -> FloatArray:
    """Modes V of snapshots [m] of shape [n_snapshots, n d]: orthonormal columns [-], shape [n d, r].

    There are as many modes as independent snapshots, and not more than ``most``. Raises ValueError if all
    snapshots are zero.
    """
    U = np.asarray(snapshots, dtype=float)
    squares, vectors = np.linalg.eigh(U @ U.T)
    squares, vectors = squares[::-1], vectors[:, ::-1]
    modes = min(most, int((squares > SMALLEST * squares[0]).sum()))
    if modes < 1:
        raise ValueError("a reduced model needs one mode or more, and snapshots that move")
    V = U.T @ (vectors[:, :modes] / np.sqrt(squares[:modes]))
    # the Gram matrix squares the condition number: orthonormalise again
    V, R = np.linalg.qr(V)
    return np.asarray(V * np.sign(np.diag(R)))


@dataclass(frozen=True)
class Sample:
    """Chosen elements."""

    cells: IntArray
    """Their numbers, increasing, shape [s]."""
    weights: FloatArray
    """Weight of each [-], > 0, shape [s]."""
    residual: float
    """|G w - b| / |b| [-]."""
    reached: bool


def choose(G: FloatArray, *, tolerance: float) -> Sample:
    """Choose elements and weights, Eq. (R.2).

    ``G``: contributions of the m elements, shape [n, m]. ``tolerance``: tau, in (0, 1).
    """
    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"tolerance must be in (0, 1), got {tolerance}")
    b = G.sum(axis=1)
    size = float(np.linalg.norm(b))
    limit = min(G.shape)
    sizes = np.linalg.norm(G, axis=0)
    w = np.zeros(G.shape[1])
    active: list[int] = []
    residual = b.copy()
    barred = sizes == 0.0
    while np.linalg.norm(residual) > tolerance * size and len(active) < limit:
        gain = (residual @ G) / np.where(barred, np.inf, sizes)
        gain[active] = -np.inf
        best = int(np.argmax(gain))
        if not gain[best] > 0.0:
            break
        active.append(best)
        while True:
            found = np.linalg.lstsq(G[:, active], b, rcond=None)[0]
            if (found > 0.0).all():
                w[:] = 0.0
                w[active] = found
                break
            # the path to the unconstrained optimum ends at the first weight that becomes zero
            old = w[active]
            falling = found <= 0.0
            share = float((old[falling] / (old[falling] - found[falling])).min())
            w[active] = old + share * (found - old)
            active = [e for e in active if w[e] > 1e-14 * w.max()]
            w[[e for e in range(len(w)) if e not in active]] = 0.0
            if not active:
                break
        before = residual
        residual = b - G @ w
        if np.linalg.norm(residual) >= (1.0 - 1e-12) * np.linalg.norm(before):
            barred[best] = True  # no improvement: do not try it again
    cells = np.flatnonzero(w > 0.0)
    left = float(np.linalg.norm(residual)) / size
    return Sample(cells, w[cells], left, left <= tolerance)


ITERATIONS = 30
"""Maximum number of iterations for an equilibrium."""


@dataclass(frozen=True)
class ReducedState:
    """An equilibrium of a reduced model."""

    q: FloatArray
    """Amplitudes of the modes [m], shape [r]."""
    slopes: FloatArray
    """dq/dp by each pressure [m/Pa], shape [r, n_pressures]."""
    outcome: Outcome
    iterations: int


class ReducedModel:
    """A model, its basis, and the sampled elements."""

    def __init__(self, model: Model, V: FloatArray, sample: Sample, *, gravity: str | None = None) -> None:
        """Make the reduced model with modes V [-] of shape [n d, r]. The conditions of `model` must be
        supports, weight and pressures. `gravity` is the history of the weight's factor."""
        _checked(model)
        self.model, self.V, self.sample = model, V, sample
        self.pressures = tuple(c.history for c in model.conditions if isinstance(c, Pressure))
        equations = Equations(model, model.parameters())
        self._loads = [_polynomial(equations, number, V) for number in range(len(self.pressures))]
        at = {name: 0.0 for name in model.histories}
        if gravity is not None:
            at[gravity] = 1.0
        self.weight = V.T @ equations.evaluate(np.zeros(model.n_dofs), at).carried
        used, cells = np.unique(model.mesh.cells[sample.cells], return_inverse=True)
        small = Mesh(model.mesh.points[used], cells.reshape(len(sample.cells), -1), model.mesh.kind)
        regions = model.cell_regions[sample.cells]
        present, regions = np.unique(regions, return_inverse=True)
        part = Model(small, model.solid, kinematics=model.kinematics, gauss=model.gauss, regions=regions)
        self._points = Points(part)
        self._rows = self._points.rows(model.parameters()[present])
        self._rows_of = V[components(used[:, None], model.dimension).ravel()]
        self._of_cells = self._rows_of[components(small.cells, model.dimension)]
        self._weighted = sample.weights[:, None, None] * self._of_cells

    @property
    def modes(self) -> int:
        """Number of unknowns r."""
        return self.V.shape[1]

    def rows(self, where: str) -> FloatArray:
        """Mean of the modes over a set of points [-], shape [d, r]."""
        d = self.model.dimension
        V = self.V.reshape(-1, d, self.modes)
        return np.asarray(V[self.model.mesh.nodes(where)].mean(axis=0))

    def internal(self, q: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
        """Reduced internal forces [N], their tangent [N/m], and True if an element is inverted."""
        u = (self._rows_of @ q).reshape(-1, self.model.dimension)
        state = self._points.evaluate(u, self._rows, tangent=True)
        assert state.stiffness is not None
        forces = np.einsum("ekr,ek->r", self._weighted, state.forces)
        half = np.matmul(state.stiffness, self._of_cells)
        tangent = np.einsum("ekr,eks->rs", self._weighted, half, optimize=True)
        return forces, tangent, bool((state.J <= 0.0).any())

    def loads(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Reduced forces per unit pressure [m2], shape [n_p, r], and their derivatives [m], [n_p, r, r]."""
        forces, by = [], []
        for a, B, C in self._loads:
            Cq = C @ q  # [r, r]: derivative of B q + 1/2 q C q is B + C q
            forces.append(a + B @ q + 0.5 * Cq @ q)
            by.append(B + Cq)
        return np.array(forces), np.array(by)

    def equilibrium(
        self,
        pressures: Sequence[float] | FloatArray,
        *,
        start: FloatArray | None = None,
        tolerance: float = 1e-9,
    ) -> ReducedState:
        """Find the equilibrium under pressures [Pa] of shape [n_pressures] from amplitudes `start`."""
        p = np.asarray(pressures, dtype=float)
        q = np.zeros(self.modes) if start is None else np.asarray(start, dtype=float).copy()
        nothing = np.full((self.modes, len(p)), np.nan)
        for iteration in range(ITERATIONS + 1):
            internal, tangent, inverted = self.internal(q)
            if inverted or not np.isfinite(internal).all():
                return ReducedState(q, nothing, Outcome.INVERTED, iteration)
            unit, by = self.loads(q)
            external = p @ unit + self.weight
            residual = internal - external
            K = tangent - np.tensordot(p, by, axes=1)
            scale = max(float(np.linalg.norm(internal)), float(np.linalg.norm(external)))
            try:
                if float(np.linalg.norm(residual)) <= tolerance * scale:
                    return ReducedState(
                        q,
                        np.asarray(np.linalg.solve(K, unit.T), dtype=np.float64),
                        Outcome.COMPLETED,
                        iteration,
                    )
                q = q - np.linalg.solve(K, residual)
            except np.linalg.LinAlgError:
                return ReducedState(q, nothing, Outcome.SINGULAR, iteration)
        return ReducedState(q, nothing, Outcome.NOT_CONVERGED, ITERATIONS)


def reduce(
    model: Model, snapshots: FloatArray, *, modes: int, tolerance: float, gravity: str | None = None
) -> ReducedModel:
    """Make a reduced model from displacements of its equilibria [m], shape [n_snapshots, n, d].

    ``modes``: maximum number of unknowns. ``tolerance``: tolerance for choosing the elements, Eq. (R.2).
    ``gravity``: history of the weight's factor.
    """
    flat = snapshots.reshape(len(snapshots), -1)
    V = decompose(flat, modes)
    return ReducedModel(model, V, choose(shares(model, V, flat), tolerance=tolerance), gravity=gravity)


def shares(model: Model, V: FloatArray, snapshots: FloatArray) -> FloatArray:
    """The elements' contributions to the reduced forces of projected snapshots [N], [n_snapshots r, m]."""
    points = Points(model)
    rows = points.rows(model.parameters())
    of_cells = V[components(model.mesh.cells, model.dimension)]
    found = []
    for u in snapshots:
        projected = V @ (V.T @ u)
        state = points.evaluate(projected.reshape(model.mesh.points.shape), rows, tangent=False)
        share = np.einsum("ekr,ek->re", of_cells, state.forces)
        found.append(share / np.linalg.norm(share.sum(axis=1)))
    return np.concatenate(found)


def _polynomial(
    equations: Equations, number: int, V: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """a, B and C of Eq. (R.3) of one pressure, of shapes [r], [r, r], [r, r, r]."""
    load = equations.pressures[number][1]

    def at(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        force, derivatives = load.evaluate(u)
        tangent = np.zeros((V.shape[1], V.shape[1]))
        for cells, by in derivatives:
            of_cells = V[equations.body.pattern.dofs[cells]]
            tangent += np.einsum("fkr,fkl,fls->rs", of_cells, by, of_cells, optimize=True)
        return V.T @ force, tangent

    a, B = at(np.zeros(len(V)))
    # C_ijk = d2 f_i / dq_j dq_k: the derivative is linear in q; a unit amplitude therefore gives it exactly
    C = np.stack([at(V[:, k])[1] - B for k in range(V.shape[1])], axis=-1)
    return a, B, C


def _checked(model: Model) -> None:
    wrong = [
        c
        for c in model.conditions
        if isinstance(c, Prescribed | Coupled | NodalForce | Traction | RigidSurface | SelfContact)
    ]
    if wrong:
        raise ValueError(f"a reduced model has supports, weight and pressures, not {wrong[0]}")
    if model.volumetric != "displacement":
        raise ValueError('a reduced model has volumetric = "displacement"')
    if model.kinematics != "3d":
        raise ValueError("a reduced model is three-dimensional: its pressure is then of second degree")
    if sum(isinstance(c, Gravity) for c in model.conditions) > 1:
        raise ValueError("a reduced model has one weight")
