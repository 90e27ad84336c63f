"""A cylinder compressed between rigid platens with Coulomb friction, in equilibrium at every step.

`compress` returns force and shape, and their derivatives by the constants of the law and by the friction.
Contact is checked point by point: no penetration, sticking or sliding.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from explicit.materials.law import Stretches
from kolsky.base.arrays import FloatArray
from kolsky.equilibrium.linear.base import Pattern
from kolsky.equilibrium.loads import cell_with, faces_on
from kolsky.equilibrium.meshes import Mesh
from kolsky.material.end_friction.cylinder import Body


@dataclass(frozen=True)
class Compression:
    """Force and shape of a compressed cylinder at chosen strains."""

    stress: FloatArray
    """Force over the undeformed section [Pa], compression positive, shape [n]."""
    bulge: FloatArray
    """Radius at mid-height [m], shape [n]."""
    stress_by: FloatArray
    """Derivatives of the stress by the parameters, shape [n, n_parameters]."""
    bulge_by: FloatArray
    """Derivatives of the radius [m], shape [n, n_parameters]."""
    past: float
    """Share of the volume that is strained past the homogeneous strain of the last point [-]."""
    snaps: int
    """Number of jumps to another equilibrium. In a jump, a node of the edge comes into contact or leaves
    it."""


GAUSS = 5
"""Gauss points of the side in each boundary element."""


@dataclass(frozen=True)
class ContactPoints:
    """Points on the body's boundary and their share of its undeformed area."""

    cells: NDArray[np.int64]
    """Element of each point, shape [n]."""
    shape: FloatArray
    """Weights of the element's nodes in the point [-], shape [n, 9]."""
    areas: FloatArray
    """Undeformed area of each point [m^2], shape [n]."""
    matrix: csr_array
    """Values at the points from values at the nodes, shape [n, n_nodes]."""

    @classmethod
    def of(cls, mesh: Mesh, *, face: bool) -> "ContactPoints":
        """Points of the side, and those of the face if it can move."""
        (side,) = faces_on(mesh, "right", GAUSS)
        radius, z = mesh.points[:, 0].max(), mesh.points[mesh.nodes("right"), 1]
        heights = mesh.points[mesh.cells[side.cells], 1] @ side.slopes[:, :, 0].T
        cells = np.repeat(side.cells, GAUSS)
        shape = np.tile(side.values, (side.cells.size, 1))
        areas = (2.0 * np.pi * radius * heights * side.weights).ravel()
        if face:
            top = mesh.nodes("top")
            r = mesh.points[top, 0]
            ends = np.concatenate([r[:1], 0.5 * (r[1:] + r[:-1]), r[-1:]])
            own = 2.0 * np.pi * np.maximum(r, 0.25 * r[1]) * np.diff(ends)
            own[-1] += np.pi * radius * (z[-1] - z[-2])  # the edge has a part of the side
            above = cell_with(mesh.cells, top)
            cells = np.concatenate([cells, above])
            shape = np.concatenate([shape, mesh.cells[above] == top[:, None]])
            areas = np.concatenate([areas, own])
        places = (np.repeat(np.arange(cells.size), 9), mesh.cells[cells].ravel())
        matrix = csr_array((shape.ravel(), places), shape=(cells.size, len(mesh.points)))
        return cls(cells, shape, areas, matrix)

    def at(self, values: FloatArray) -> FloatArray:
        """Values at the points from nodal values, shape [n_nodes, ...]."""
        return np.asarray(self.matrix @ values)

    def shared(self, forces: FloatArray) -> FloatArray:
        """Forces on the points as forces on the nodes, shape [n_nodes, ...]."""
        return np.asarray(self.matrix.T @ forces)

    def added(self, elements: FloatArray, blocks: FloatArray) -> FloatArray:
        """Element matrices [n_elements, 18, 18] with the matrix of each point, shape [n, 2, 2]."""
        on = np.flatnonzero(blocks.any(axis=(1, 2)))
        shared = self.shape[on, :, None, None, None] * self.shape[on, None, None, :, None]
        each = blocks[on, None, :, None, :] * shared
        total = elements.copy()
        np.add.at(total, self.cells[on], each.reshape(-1, 18, 18))
        return total


_STIFF = 200.0
"""Penalty divided by shear modulus and smallest element [-]."""


@dataclass(frozen=True)
class Grip:
    """State of each contact point at the last equilibrium."""

    touching: NDArray[np.bool_]
    """True for a point on the platen, shape [n_contact]."""
    anchor: FloatArray
    """Radius at which its tangential force is zero [m], shape [n_contact]."""
    anchor_change: FloatArray
    """Derivatives of the anchors by the parameters, shape [n_contact, n_parameters]."""
    normal: FloatArray
    """Force pressing the point down [N], shape [n_contact]."""
    normal_change: FloatArray
    """Its derivatives by the parameters, shape [n_contact, n_parameters]."""


@dataclass(frozen=True)
class ContactForces:
    """Forces on the contact points and their derivatives."""

    normal: FloatArray
    """Force pressing the point down [N], >= 0, shape [n_contact]."""
    tangential: FloatArray
    """Radial force [N], shape [n_contact]."""
    stiffness: FloatArray
    """d(radial, axial force on the point) / d(r, z), row by row [N/m], shape [n_contact, 2, 2]."""
    stuck: NDArray[np.bool_]
    """True for a point that sticks, shape [n_contact]."""
    slip: FloatArray
    """Sign of the radial force of a sliding point, 0 for the others [-], shape [n_contact]."""


@dataclass(frozen=True)
class Platen:
    """A platen that moves down onto a body."""

    mesh: Mesh
    bonded: bool
    """True if the face is glued. Then only the side can come into contact, and it sticks."""
    friction: float
    """Coulomb's coefficient [-]; infinity: no slip."""
    modulus: float
    """Shear modulus that scales the penalty [Pa]."""

    @cached_property
    def points(self) -> ContactPoints:
        """Points that can touch."""
        return ContactPoints.of(self.mesh, face=not self.bonded)

    @cached_property
    def penalty(self) -> FloatArray:
        """k A of each point [N/m], shape [n_contact]."""
        r, z = self.mesh.points.T
        smallest = min(np.diff(np.unique(r)).min(), np.diff(np.unique(z)).min()) * 2.0
        return np.asarray(_STIFF * self.modulus / smallest * self.points.areas)

    @property
    def coefficient(self) -> float:
        """d(radial force)/d(normal force) of a sliding point [-]; 0 if no point slides."""
        return self.friction if np.isfinite(self.friction) else 0.0

    def at_rest(self, n_parameters: int) -> Grip:
        """State before the platen moves: the face is in contact."""
        r, z = self.points.at(self.mesh.points).T
        nothing = np.zeros((r.size, n_parameters))
        touching = z >= self.mesh.points[:, 1].max() * (1.0 - 1e-9)
        return Grip(touching, r, nothing, np.zeros(r.size), nothing)

    def forces(self, x: FloatArray, level: float, grip: Grip) -> ContactForces:
        """Forces at the nodes' positions x, shape [n_nodes, 2], under a platen at a height [m]."""
        r, z = self.points.at(x).T
        k = self.penalty
        normal = np.maximum(grip.normal + k * (z - level), 0.0)
        pressed = normal > 0.0
        trial = np.where(pressed & grip.touching, -k * (r - grip.anchor), 0.0)
        limit = self.coefficient * normal if np.isfinite(self.friction) else np.full(k.size, np.inf)
        slip = np.where(np.abs(trial) > limit, np.sign(trial), 0.0)
        tangential = np.where(slip == 0.0, trial, slip * (self.coefficient * normal))
        stuck = pressed & grip.touching & (slip == 0.0)
        stiffness = np.zeros((k.size, 2, 2))
        stiffness[:, 1, 1] = np.where(pressed, -k, 0.0)
        stiffness[:, 0, 0] = np.where(stuck, -k, 0.0)
        stiffness[:, 0, 1] = slip * self.coefficient * k
        return ContactForces(normal, tangential, stiffness, stuck, slip)


STEP = 0.01
"""Largest step of compression [-]."""
LEAST_STEP = 5e-4
"""Smallest step in the search for an equilibrium [-]."""
ITERATIONS = 20
"""Largest number of Newton iterations of a step."""
FULL = 8
"""Number of iterations with full steps. Later steps are shortened, because nodes that alternately touch and
separate cause cycles."""
FIRST_DRAG, LAST_DRAG = 10.0, 0.02
"""Drag of the first and of the last creep step, divided by the body's stiffness [-]. After the last step it
is 0."""
CREEP_STEPS, CREEP_FAILURES = 60, 8
"""Largest number of creep steps, and of failed creep steps."""
_BALANCED = 1e-7
"""Sum of unbalanced nodal forces, divided by the sum of the nodes' internal forces. Below this, a step has
converged."""


def compress(
    laws: Sequence[Stretches],
    mesh: Mesh,
    strain: FloatArray,
    *,
    bulk: float,
    modulus: float,
    steps: FloatArray | None = None,
    bonded: bool = True,
    friction: float = float("inf"),
    by_friction: bool = False,
) -> Compression:
    """Compress a cylinder between platens.

    ``laws``: the law, then one law per parameter. In each of these, the parameter is changed by its entry of
    `steps`. ``strain``: nominal compressive strains to record, ascending inside (0, 1) [-], shape [n].
    ``bulk``: bulk modulus K [Pa]. ``modulus``: shear modulus at rest, which scales the contact penalty [Pa].
    ``steps``: change of each parameter, shape [n_parameters]. ``bonded``: True if the faces are glued to the
    platens. The side then sticks too where it comes into contact. ``friction``: Coulomb's coefficient of face
    and side if they are not glued; infinity: they do not slip [-]. ``by_friction``: True if the coefficient
    is an additional parameter, the last one.
    """
    if strain.size < 1 or strain[0] <= 0.0 or strain[-1] >= 1.0 or (np.diff(strain) <= 0.0).any():
        raise ValueError("strains of a compression must ascend inside (0, 1)")
    run = _March(laws, mesh, Platen(mesh, bonded, friction, modulus), bulk, steps, by_friction)
    rows = [run.reach(float(e)) for e in strain]
    state = run.body.deformation(run.u)
    s = np.sqrt(
        np.maximum((state.stretch**2).sum(axis=-1) / np.cbrt(state.stretch.prod(axis=-1)) ** 2 - 3.0, 0.0)
    )
    lam = 1.0 - strain[-1]
    volume = run.body.volumes
    area = np.pi * mesh.points[:, 0].max() ** 2
    return Compression(
        stress=np.array([row[0] for row in rows]) / area,
        bulge=np.array([row[1] for row in rows]),
        stress_by=np.array([row[2] for row in rows]) / area,
        bulge_by=np.array([row[3] for row in rows]),
        past=float(volume[s > (1.0 - lam) * np.sqrt((lam + 2.0) / lam)].sum() / volume.sum()),
        snaps=run.snaps,
    )


class _March:
    """The state of a compression."""

    def __init__(
        self,
        laws: Sequence[Stretches],
        mesh: Mesh,
        platen: Platen,
        bulk: float,
        steps: FloatArray | None,
        by_friction: bool,
    ) -> None:
        self.laws, self.mesh, self.platen, self.body = laws, mesh, platen, Body(mesh, bulk)
        self.parameter_steps = np.zeros(0) if steps is None else steps
        self.by_friction = by_friction
        n = self.parameter_steps.size + by_friction
        size = mesh.points.size
        self.u, self.before, self.at = np.zeros(size), np.zeros(size), (0.0, 0.0)
        self.change = np.zeros((size, n))
        self.grip: Grip = platen.at_rest(n)
        radius, self.height = mesh.points.max(axis=0)
        face, self.middle = 2 * mesh.nodes("top"), 2 * mesh.nodes("bottom") + 1
        fixed = np.zeros(size, dtype=bool)
        fixed[2 * mesh.nodes("left")] = fixed[self.middle] = True
        self.glued = face + 1 if platen.bonded else face[:0]
        fixed[self.glued] = fixed[self.glued - 1] = True
        self.free = np.flatnonzero(~fixed)
        index = np.full(size, -1)
        index[self.free] = np.arange(self.free.size)
        self.pattern = Pattern(self.body.dofs, index, self.free.size)
        # Drag equal to the stiffness of the whole body per displacement, distributed by volume.
        share = self.body.volumes.sum(axis=1) / self.body.volumes.sum() / 9.0
        self.drag_unit = 3.0 * platen.modulus * np.pi * radius**2 / self.height * share
        self.snaps = 0
        self.drag, self.crept = 0.0, np.zeros(size)
        self.drag_forces = self.pattern.vector(np.repeat(self.drag_unit[:, None], 18, axis=1))

    def reach(self, strain: float) -> tuple[float, float, FloatArray, FloatArray]:
        """Force, bulge and their derivatives at a strain."""
        size = STEP
        while self.at[1] < strain - 1e-12:
            to = min(self.at[1] + size, strain)
            if strain - to < 0.2 * size:
                to = strain
            if self._step(to):
                size = min(STEP, 1.5 * size)
            elif 0.5 * (to - self.at[1]) < LEAST_STEP:
                if self._creep(to):
                    size = STEP
                    continue
                raise ValueError(
                    f"no equilibrium near the last one at a compression of {100.0 * to:.1f} %: the body"
                    " buckles, folds or its law is unstable; end the curve earlier or take another law"
                )
            else:
                size = 0.5 * (to - self.at[1])
        internal, _, _ = self._balance(self.laws[0], self.u, strain)
        edge = self.middle[-1] - 1  # the radius at mid-height
        return (
            float(internal[self.middle].sum()),
            float(self.mesh.points[:, 0].max() + self.u[edge]),
            self.force_change,
            self.change[edge].copy(),
        )

    def _balance(
        self, law: Stretches, u: FloatArray, strain: float
    ) -> tuple[FloatArray, ContactForces, FloatArray]:
        """Internal forces, contact forces and the stiffness of elements."""
        state = self.body.deformation(u)
        if not state.valid:
            raise FloatingPointError("an element is turned inside out")
        force, stiffness = self.body.forces(law, state)
        level = self.height * (1.0 - strain)
        contact = self.platen.forces(self.mesh.points + u.reshape(-1, 2), level, self.grip)
        return self.pattern.vector(force), contact, stiffness

    def _step(self, to: float) -> bool:
        """Equilibrium at a strain; False if it was not found."""
        last, now = self.at
        guess = self.u.copy()
        if last < now:
            guess += (self.u - self.before) * (to - now) / (now - last)
        else:
            guess[1::2] -= self.mesh.points[:, 1] * to
            if self.platen.bonded:
                guess[0::2] += self.mesh.points[:, 0] * 0.5 * to
                guess[self.glued - 1] = 0.0
        for start in (guess, self.u.copy()):
            start[self.glued] = -to * self.height
            found = self._newton(start, to)
            if found is not None:
                self._accept(found, to)
                return True
            if last == now:
                break
        return False

    def _creep(self, to: float) -> bool:
        """Overdamped motion to rest at a constant strain, if no equilibrium is near; False if it fails."""
        start = self.u.copy()
        start[self.glued] = -to * self.height
        self.crept, self.drag = self.u.copy(), FIRST_DRAG
        failures = 0
        for _ in range(CREEP_STEPS):
            found = self._newton(start, to)
            if found is None:
                failures += 1
                if failures > CREEP_FAILURES:
                    break
                self.drag = max(4.0 * self.drag, 4.0 * LAST_DRAG)
                continue
            start, self.crept = found, found.copy()
            if self.drag == 0.0:
                self.snaps += 1
                self._accept(found, to)
                self.before = self.u.copy()
                return True
            self.drag = 0.5 * self.drag if self.drag > LAST_DRAG else 0.0
        self.drag = 0.0
        return False

    def _newton(self, u: FloatArray, to: float) -> FloatArray | None:
        points = self.platen.points
        with np.errstate(all="ignore"):
            for count in range(ITERATIONS):
                try:
                    internal, contact, stiffness = self._balance(self.laws[0], u, to)
                except FloatingPointError:
                    return None
                rest = internal + self.drag * self.drag_forces * (u - self.crept)
                rest[0::2] -= points.shared(contact.tangential)
                rest[1::2] += points.shared(contact.normal)
                size = np.abs(rest[self.free]).sum()
                if not np.isfinite(size):
                    return None
                elements = points.added(stiffness, -contact.stiffness)
                elements += self.drag * self.drag_unit[:, None, None] * np.eye(18)
                try:
                    # The pattern is symmetric, and most of the matrix too. Orderings of A + A^T therefore
                    # have the least fill-in.
                    self.factor = splu(
                        self.pattern.matrix(np.swapaxes(elements, 1, 2)).T,  # in columns
                        permc_spec="MMD_AT_PLUS_A",
                        diag_pivot_thresh=0.1,
                        options={"SymmetricMode": True},
                    )
                except RuntimeError:
                    return None
                if size < _BALANCED * np.abs(internal).sum():
                    return u
                step = np.zeros_like(u)
                step[self.free] = -self.factor.solve(rest[self.free])
                most = np.abs(step).max() / (0.2 * self.height)
                share = 1.0 if count < FULL else 0.3 + 0.7 * ((0.618034 * count) % 1.0)
                u = u + min(share, 1.0 / max(1.0, most)) * step
        return None

    def _accept(self, u: FloatArray, to: float) -> None:
        """Keep an equilibrium, with its derivatives."""
        _, contact, stiffness = self._balance(self.laws[0], u, to)
        state, points = self.body.deformation(u), self.platen.points
        n = self.change.shape[1]
        by = np.zeros((u.size, n))
        base = self.body.isochoric_forces(self.laws[0], state)
        for j, (law, step) in enumerate(zip(self.laws[1:], self.parameter_steps, strict=True)):
            by[:, j] = self.pattern.vector(self.body.isochoric_forces(law, state) - base) / step
        direct = by.copy()
        pressed = (contact.normal > 0.0)[:, None] * self.grip.normal_change
        c, k, slip = contact.stiffness, self.platen.penalty[:, None], contact.slip
        held = -c[:, 0, 0, None] * self.grip.anchor_change
        held += (slip * self.platen.coefficient)[:, None] * pressed
        if self.by_friction:
            held[:, -1] += slip * contact.normal
        direct[0::2] -= points.shared(held)
        direct[1::2] += points.shared(pressed)
        change = np.zeros_like(by)
        if n:
            change[self.free] = -self.factor.solve(direct[self.free])
        # The force is that of the internal forces at mid-height. It depends on the parameters and on the
        # displacements.
        dofs = self.body.dofs
        moved = np.einsum("ekl,eln->ekn", stiffness, change[dofs], optimize=True)
        at_middle = np.isin(dofs, self.middle)[:, :, None]
        self.force_change = (moved * at_middle).sum(axis=(0, 1)) + by[self.middle].sum(axis=0)
        out, down = points.at(change[0::2]), points.at(change[1::2])
        slid = c[:, 0, 0, None] * out + c[:, 0, 1, None] * down + held
        r = points.at(self.mesh.points + u.reshape(-1, 2))[:, 0]
        touching = contact.normal > 0.0
        pressing = np.where(touching[:, None], self.grip.normal_change + k * down, 0.0)
        anchor = np.where(contact.stuck, self.grip.anchor, r + contact.tangential / k[:, 0])
        anchor_change = np.where(contact.stuck[:, None], self.grip.anchor_change, out + slid / k)
        self.grip = Grip(touching, anchor, anchor_change, contact.normal, pressing)
        self.before, self.u, self.at, self.change = self.u, u, (self.at[1], to), change
