"""Equations of equilibrium of a model: residual and tangent of the unknown displacements."""

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from explicit.arrays import FloatArray
from kolsky.equilibrium.body import Body, BodyState
from kolsky.equilibrium.linear.base import Factors
from kolsky.equilibrium.linear.solvers import BridgedSolver, LinearSolver, linear_solver
from kolsky.equilibrium.loads import FollowerPressure, RigidContact, nodal_forces, weight
from kolsky.equilibrium.model import Model, Pressure, RigidSurface
from kolsky.equilibrium.surface_contact import surface_contacts


@dataclass(frozen=True)
class State:
    """A state that may differ from an equilibrium."""

    at: dict[str, float]
    u: FloatArray
    """Displacements [m], shape [n d]."""
    body: BodyState
    """Its internal forces."""
    carried: FloatArray
    """Weight and pressure forces on the points [N], shape [n d]."""
    external: FloatArray
    """All external forces of the points with contact [N], shape [n d]."""
    residual: FloatArray
    """Internal minus external forces of the unknowns [N], shape [n_unknowns]."""
    multipliers: tuple[FloatArray, ...] = ()
    """Multipliers of the points of each contact [N]."""

    @property
    def inverted(self) -> bool:
        """True if the body is inverted at a point."""
        return self.body.inverted


class Equations:
    """A model with its constants."""

    def __init__(self, model: Model, parameters: FloatArray, *, linear: str = "auto") -> None:
        self.model = model
        self.body = Body(model, parameters)
        self.pressures = [
            (c.history, FollowerPressure(model, c.where)) for c in model.conditions if isinstance(c, Pressure)
        ]
        self.contacts = [RigidContact(model, c) for c in model.conditions if isinstance(c, RigidSurface)]
        self.surfaces = surface_contacts(model)
        self.symmetric = not self.pressures
        self.linear = linear
        self.smooth = not (self.contacts or self.surfaces)
        """True if a tangent is valid for neighbouring states. With changing contact it is not valid."""
        size = float(np.ptp(model.mesh.points, axis=0).max())
        depth = model.thickness if model.kinematics.startswith("plane") else size
        self.floor = 1e-13 * model.solid.shear_modulus * size * depth
        """Residual by round-off at rest [N], used if there are no forces for comparison."""

    def with_parameters(self, parameters: FloatArray) -> "Equations":
        """The equations with other constants. Geometry and fronts are shared."""
        changed = copy(self)
        changed.body = self.body.with_parameters(parameters)
        return changed

    @cached_property
    def solver(self) -> LinearSolver:
        """The linear solver, created at first use. Forces are evaluated without it."""
        mesh = self.model.mesh
        return linear_solver(self.linear, self.body.pattern, mesh.points, mesh.cells)

    @cached_property
    def _bridged(self) -> BridgedSolver:
        mesh = self.model.mesh
        return BridgedSolver(self.linear, self.body.pattern, mesh.points, mesh.cells)

    @property
    def worth(self) -> int:
        """Number of iterations with a reused tangent that take about the time of one factorisation."""
        return self.solver.worth if self.smooth else 1

    def with_prescribed(self, u: FloatArray, at: Mapping[str, float]) -> FloatArray:
        """Displacements with the prescribed components at given histories, shape [n d]."""
        moved = u.copy()
        for dofs, name, factor in self.model.unknowns.prescribed:
            moved[dofs] = factor * at[name]
        return moved

    def expanded(self, unknowns: FloatArray) -> FloatArray:
        """Changes of the unknowns, given in all components, shape [..., n d]."""
        return self.body.pattern.expanded(unknowns)

    def reduced(self, full: FloatArray) -> FloatArray:
        """Forces of all components, summed to those of the unknowns, shape [..., n_unknowns]."""
        return self.body.pattern.reduced(full)

    def rest(self) -> State:
        """The undeformed state, all histories at 0."""
        return self.evaluate(np.zeros(self.model.n_dofs), dict.fromkeys(self.model.histories, 0.0))

    def evaluate(
        self,
        u: FloatArray,
        at: dict[str, float],
        *,
        like: State | None = None,
        multipliers: tuple[FloatArray, ...] | None = None,
    ) -> State:
        """State at displacements [m] of shape [n d]. `like`: a near state, for multipliers and thickness."""
        body = self.body.evaluate(u, start=None if like is None else like.body)
        if multipliers is None:
            multipliers = tuple(np.zeros(len(c.nodes)) for c in self.contacts)
            multipliers = multipliers if like is None else like.multipliers
        carried = self._carried(u, at)
        external = self._external(u, at, multipliers, carried)
        return State(at, u, body, carried, external, self.reduced(body.forces - external), multipliers)

    def excess(self, state: State, tolerance: float) -> float:
        """The residual divided by its tolerance [-]."""
        scale = max(float(np.linalg.norm(state.body.forces)), float(np.linalg.norm(state.external)))
        return float(np.linalg.norm(state.residual)) / max(tolerance * scale, self.floor)

    def converged(self, state: State, tolerance: float) -> bool:
        """True if the residual is below its tolerance."""
        return self.excess(state, tolerance) <= 1.0

    def augmented(self, state: State) -> tuple[tuple[FloatArray, ...], bool]:
        """Multipliers increased by the penalty forces, and True if the depth was already within tolerance."""
        pushes, closed = [], True
        for contact, pushed in zip(self.contacts, state.multipliers, strict=True):
            place = contact.place(state.u, state.at)
            pushes.append(contact.pushes(place, pushed))
            apart = np.where(pushes[-1] > 0.0, np.abs(place.gaps), -np.minimum(place.gaps, 0.0))
            closed = closed and bool(apart.max(initial=0.0) <= contact.depth)
        return tuple(pushes), closed

    def carried_stiffness(self, state: State, *, single: bool = False) -> FloatArray:
        """Tangent of the internal forces minus weight and pressure, for each element [N/m]."""
        elements = self.body.stiffness(state.body, single=single)
        for name, pressure in self.pressures:
            for cells, by in pressure.evaluate(state.u)[1]:
                np.add.at(elements, cells, -state.at[name] * by)
        return elements

    def stiffness(self, state: State, *, single: bool = False) -> FloatArray:
        """Tangent of the residual, for each element [N/m], shape [m, k d, k d]. `single`: single precision,
        for factors that only guide an iteration."""
        return self.with_contact(self.carried_stiffness(state, single=single), state, held=False)

    def with_contact(self, elements: FloatArray, state: State, *, held: bool) -> FloatArray:
        """Element matrices with the stiffness of the points in contact. `held` fixes these points on their
        surface. Derivatives of the solution need this. Without points in contact, the unchanged array is
        returned."""
        if self.contacts:
            elements = elements.copy()
        for contact, blocks in zip(self.contacts, self.contact_blocks(state, held=held), strict=True):
            contact.add_stiffness(elements, blocks)
        return elements

    def contact_blocks(self, state: State, *, held: bool) -> list[FloatArray]:
        """Stiffness of the points of each contact [N/m], shape [p, d, d]."""
        found = []
        for contact, pushed in zip(self.contacts, state.multipliers, strict=True):
            place = contact.place(state.u, state.at)
            found.append(contact.blocks(place, contact.pushes(place, pushed), held=held))
        return found

    def factors(self, elements: FloatArray, state: State | None = None) -> Factors:
        """Factors of the element matrices plus the stiffness of surface contact in a state."""
        nodes, blocks = [], []
        if state is not None:
            for contact in self.surfaces:
                pairs, stiff = contact.blocks(state.u)
                nodes.append(contact.nodes_of(pairs))
                blocks.append(stiff)
        if sum(map(len, nodes)) == 0:
            return self.solver.factors(elements, symmetric=self.symmetric)
        joined = np.concatenate(nodes), np.concatenate(blocks)
        return self._bridged.factors(elements, *joined, symmetric=self.symmetric)

    def closed(self, state: State) -> bool:
        """True if the penetration of all surfaces is within the limit."""
        return all(contact.deepest(state.u) <= contact.depth for contact in self.surfaces)

    def times(self, elements: FloatArray, du: FloatArray) -> FloatArray:
        """Element matrices times changes [m] of shape [..., n d], summed over all components [N]."""
        dofs = self.body.pattern.dofs
        rows = np.atleast_2d(du)
        products = np.matmul(elements, np.moveaxis(rows[:, dofs], 0, 2))
        found = np.array([self.body.pattern.vector(products[..., j]) for j in range(len(rows))])
        return found.reshape(du.shape)

    def external_change(self, state: State, at: dict[str, float]) -> FloatArray:
        """Change of the loads with the histories at fixed displacements [N], in the unknowns."""
        loads = nodal_forces(self.model, at) - nodal_forces(self.model, state.at)
        return self.reduced(loads + self.carried_change(state, at))

    def carried_change(self, state: State, at: dict[str, float]) -> FloatArray:
        """Change of weight and pressure with the histories at fixed displacements [N], shape [n d]."""
        return self._carried(state.u, at) - state.carried

    def _carried(self, u: FloatArray, at: dict[str, float]) -> FloatArray:
        total = weight(self.model, self.body.points.geometry, at)
        for name, pressure in self.pressures:
            total = total + at[name] * pressure.evaluate(u)[0]
        return total

    def _external(
        self, u: FloatArray, at: dict[str, float], multipliers: tuple[FloatArray, ...], carried: FloatArray
    ) -> FloatArray:
        total = carried + nodal_forces(self.model, at)
        for contact, pushed in zip(self.contacts, multipliers, strict=True):
            place = contact.place(u, at)
            total = total + contact.forces(place, contact.pushes(place, pushed))
        for surface in self.surfaces:
            total = total + surface.forces(u)
        return total
