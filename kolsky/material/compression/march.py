"""A compression followed in equilibrium, step by step, with the derivatives of all that is measured."""

from collections.abc import Sequence

import numpy as np

from explicit.materials.law import Stretches
from kolsky.base.arrays import FloatArray
from kolsky.material.compression.body import Body
from kolsky.material.compression.equations import Equations
from kolsky.material.compression.mesh import HalfCylinder
from kolsky.material.compression.platen import ContactForces, Grip, Platen
from kolsky.material.compression.result import Compression, NoEquilibriumError

STEP = 0.01
"""Largest step of compression [-]."""
LEAST_STEP = 5e-4
"""Step below which the search for an equilibrium is given up [-]."""
ITERATIONS = 20
"""Most Newton iterations of a step."""
FULL = 8
"""Iterations with full steps; later ones are shortened, since nodes that touch and leave in turn go round."""
FIRST_DRAG, LAST_DRAG = 10.0, 0.02
"""Drag of a creep step, first and last before it is taken away, over the body's stiffness [-]."""
CREEP_STEPS, CREEP_FAILURES = 60, 8
"""Most of them, and most that may fail."""
BALANCED = 1e-7
"""Sum of unbalanced nodal forces over the sum of the nodes' internal forces at which a step has converged."""


def compress(
    laws: Sequence[Stretches],
    mesh: HalfCylinder,
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

    Parameters
    ----------
    laws
        The law, then for each parameter the law with that parameter changed by its entry of `steps`.
    mesh
        Its upper half.
    strain
        Nominal compressive strains to record, ascending inside (0, 1) [-], shape [n].
    bulk
        Bulk modulus K [Pa].
    modulus
        Shear modulus at rest, which contact is measured in [Pa].
    steps
        Change of each parameter, shape [n_parameters].
    bonded
        True if the faces are glued to the platens, where the side sticks too once it lands.
    friction
        Coulomb's coefficient of face and side if they are not; infinity: they do not slip [-].
    by_friction
        True if the coefficient is one more parameter, the last.

    Raises
    ------
    NoEquilibriumError
        If no equilibrium lies near the last one.
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
    volume = mesh.gauss[1]
    area = np.pi * mesh.radius**2
    return Compression(
        strain=strain,
        stress=np.array([row[0] for row in rows]) / area,
        bulge=np.array([row[1] for row in rows]),
        stress_by=np.array([row[2] for row in rows]) / area,
        bulge_by=np.array([row[3] for row in rows]),
        outline=np.array([row[4] for row in rows]),
        largest_s=float(s.max()),
        past=float(volume[s > (1.0 - lam) * np.sqrt((lam + 2.0) / lam)].sum() / volume.sum()),
        steps=run.steps,
        snaps=run.snaps,
    )


class _March:
    """The state of a compression."""

    def __init__(
        self,
        laws: Sequence[Stretches],
        mesh: HalfCylinder,
        platen: Platen,
        bulk: float,
        steps: FloatArray | None,
        by_friction: bool,
    ) -> None:
        self.laws, self.mesh, self.platen, self.body = laws, mesh, platen, Body(mesh, bulk)
        self.parameter_steps = np.zeros(0) if steps is None else steps
        self.by_friction = by_friction
        n = self.parameter_steps.size + by_friction
        size = 2 * len(mesh.nodes)
        self.u, self.before, self.at = np.zeros(size), np.zeros(size), (0.0, 0.0)
        self.change = np.zeros((size, n))
        self.grip: Grip = platen.at_rest(n)
        fixed = np.zeros(size, dtype=bool)
        fixed[2 * mesh.axis] = fixed[2 * mesh.middle + 1] = True
        self.glued = 2 * mesh.face + 1
        if platen.bonded:
            fixed[2 * mesh.face] = fixed[self.glued] = True
        self.free = np.flatnonzero(~fixed)
        self.equations = Equations(mesh, platen, self.free)
        self.steps = self.snaps = 0
        self.drag, self.crept = 0.0, np.zeros(size)

    def reach(self, strain: float) -> tuple[float, float, FloatArray, FloatArray, FloatArray]:
        """Force, bulge, their derivatives and the outline at a strain."""
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
                raise NoEquilibriumError(
                    f"no equilibrium near the last one at a compression of {100.0 * to:.1f} %: the body"
                    " buckles, folds or its law is unstable; end the curve earlier or take another law"
                )
            else:
                size = 0.5 * (to - self.at[1])
        x = self.mesh.nodes + self.u.reshape(-1, 2)
        internal, _, _ = self._balance(self.laws[0], self.u, strain)
        middle = 2 * self.mesh.middle + 1
        return (
            float(internal[middle].sum()),
            float(x[self.mesh.side[0], 0]),
            self.force_change,
            self.change[2 * self.mesh.side[0]].copy(),
            x[self.mesh.side],
        )

    def _balance(
        self, law: Stretches, u: FloatArray, strain: float
    ) -> tuple[FloatArray, ContactForces, FloatArray]:
        """Internal forces, contact forces and the stiffness of elements."""
        state = self.body.deformation(u)
        if not state.valid:
            raise FloatingPointError("an element is turned inside out")
        force, stiffness = self.body.forces(law, state)
        level = self.mesh.height * (1.0 - strain)
        contact = self.platen.forces(self.mesh.nodes + u.reshape(-1, 2), level, self.grip)
        return self.body.assembled(force), contact, stiffness

    def _step(self, to: float) -> bool:
        """Equilibrium at a strain; False if it was not found."""
        last, now = self.at
        guess = self.u.copy()
        if last < now:
            guess += (self.u - self.before) * (to - now) / (now - last)
        elif self.platen.bonded:
            guess[1::2] -= self.mesh.nodes[:, 1] * to
            guess[0::2] += self.mesh.nodes[:, 0] * 0.5 * to
            guess[2 * self.mesh.face] = 0.0
        else:
            guess[1::2] -= self.mesh.nodes[:, 1] * to
        for start in (guess, self.u.copy()):
            if self.platen.bonded:
                start[self.glued] = -to * self.mesh.height
            found = self._newton(start, to)
            if found is not None:
                self._accept(found, to)
                return True
            if last == now:
                break
        return False

    def _creep(self, to: float) -> bool:
        """Overdamped motion to rest at a constant strain, from where no equilibrium is near; False if there
        is none."""
        start = self.u.copy()
        if self.platen.bonded:
            start[self.glued] = -to * self.mesh.height
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
                rest = internal + self.drag * self.equations.drag_unit * (u - self.crept)
                rest[0::2] -= points.shared(contact.tangential)
                rest[1::2] += points.shared(contact.normal)
                size = np.abs(rest[self.free]).sum()
                if not np.isfinite(size):
                    return None
                try:
                    self.factor = self.equations.factor(stiffness, contact, self.drag)
                except RuntimeError:
                    return None
                if size < BALANCED * np.abs(internal).sum():
                    return u
                step = np.zeros_like(u)
                step[self.free] = -self.factor.solve(rest[self.free])
                most = np.abs(step).max() / (0.2 * self.mesh.height)
                share = 1.0 if count < FULL else 0.3 + 0.7 * ((0.618034 * count) % 1.0)
                u = u + min(share, 1.0 / max(1.0, most)) * step
        return None

    def _accept(self, u: FloatArray, to: float) -> None:
        """Keep an equilibrium, with its derivatives."""
        self.steps += 1
        _, contact, stiffness = self._balance(self.laws[0], u, to)
        state, points = self.body.deformation(u), self.platen.points
        n = self.change.shape[1]
        by = np.zeros((u.size, n))
        base = self.body.isochoric_forces(self.laws[0], state) if n else np.zeros(u.size)
        for k, (law, step) in enumerate(zip(self.laws[1:], self.parameter_steps, strict=True)):
            by[:, k] = (self.body.isochoric_forces(law, state) - base) / step
        direct = by.copy()
        pressed = (contact.normal > 0.0)[:, None] * self.grip.normal_change
        held = contact.by_anchor[:, None] * self.grip.anchor_change + contact.by_normal[:, None] * pressed
        if self.by_friction:
            held[:, -1] += contact.by_friction
        direct[0::2] -= points.shared(held)
        direct[1::2] += points.shared(pressed)
        change = np.zeros_like(by)
        if n:
            change[self.free] = -self.factor.solve(direct[self.free])
        # The force is that of the internal forces at mid-height: of the parameters and of the displacements.
        moved = np.einsum("ekl,eln->ekn", stiffness, change[self.mesh.dofs], optimize=True)
        middle = np.zeros(u.size, dtype=bool)
        middle[2 * self.mesh.middle + 1] = True
        self.force_change = (moved * middle[self.mesh.dofs][:, :, None]).sum(axis=(0, 1)) + by[middle].sum(
            axis=0
        )
        c = contact.stiffness
        out, down = points.at(change[0::2]), points.at(change[1::2])
        slid = c[:, 0, 0, None] * out + c[:, 0, 1, None] * down + held
        x = self.mesh.nodes + u.reshape(-1, 2)
        self.grip = self.platen.gripped(x, contact, self.grip, out, down, slid)
        self.before, self.u, self.at, self.change = self.u, u, (self.at[1], to), change
