"""Equations of equilibrium of a model: residual and tangent of the unknown displacements."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from implicit.integration.body import Body, BodyState
from implicit.linear.factorise import Factors, factorise
from implicit.loads import dead_forces
from implicit.model import Model


@dataclass(frozen=True)
class State:
    """A state that need not be an equilibrium."""

    at: dict[str, float]
    """Value of each history."""
    u: FloatArray
    """Displacements [m], shape [n d]."""
    body: BodyState
    """Its internal forces."""
    external: FloatArray
    """External forces of the points [N], shape [n d]."""
    residual: FloatArray
    """Internal less external forces of the unknowns [N], shape [n_unknowns]."""

    @property
    def internal(self) -> FloatArray:
        """Internal forces of the points [N], shape [n d]."""
        return self.body.forces


class Equations:
    """A model with its constants."""

    def __init__(self, model: Model, parameters: FloatArray) -> None:
        self.model = model
        self.body = Body(model, parameters)
        size = float(np.ptp(model.mesh.points, axis=0).max())
        depth = model.thickness if model.kinematics.startswith("plane") else size
        self.floor = 1e-13 * model.solid.shear_modulus * size * depth
        """Residual of rounding at rest, where there are no forces to compare with [N]."""

    def with_prescribed(self, u: FloatArray, at: Mapping[str, float]) -> FloatArray:
        """Displacements with the prescribed components of a moment, shape [n d]."""
        moved = u.copy()
        for dofs, name, factor in self.model.unknowns.prescribed:
            moved[dofs] = factor * at[name]
        return moved

    def expanded(self, unknowns: FloatArray) -> FloatArray:
        """Changes of the unknowns in all components, shape [n d]."""
        return self.body.pattern.expanded(unknowns)

    def rest(self, at: dict[str, float]) -> State:
        """The undeformed state, without its loads."""
        return self.evaluate(np.zeros(self.model.n_dofs), at)

    def evaluate(self, u: FloatArray, at: dict[str, float], *, like: State | None = None) -> State:
        """State at displacements [m] of shape [n d]; `like`: one near it."""
        body = self.body.evaluate(u, tangent=True, start=None if like is None else like.body)
        external = dead_forces(self.model, self.body.points.geometry, at)
        residual = self.body.pattern.reduced(body.forces - external)
        return State(at, u, body, external, residual)

    def converged(self, state: State, tolerance: float) -> bool:
        """Whether the residual is below its tolerance."""
        scale = max(np.linalg.norm(state.internal), np.linalg.norm(state.external))
        return bool(np.linalg.norm(state.residual) <= max(tolerance * scale, self.floor))

    def factors(self, state: State) -> Factors:
        """The tangent of a state, factorised."""
        assert state.body.stiffness is not None
        return factorise(self.body.pattern.matrix(state.body.stiffness))

    def stiffness_times(self, state: State, du: FloatArray) -> FloatArray:
        """Tangent times a change of all components [N], in the unknowns, shape [n_unknowns]."""
        return self.body.pattern.reduced(self.full_stiffness_times(state, du))

    def full_stiffness_times(self, state: State, du: FloatArray) -> FloatArray:
        """Tangent of the body times changes [m] of shape [..., n d], in all components [N]."""
        K, dofs = state.body.stiffness, self.body.pattern.dofs
        assert K is not None
        rows = np.atleast_2d(du)
        products = np.matmul(K, np.moveaxis(rows[:, dofs], 0, 2))
        found = np.array([self.body.pattern.vector(products[..., j]) for j in range(len(rows))])
        return found.reshape(du.shape)

    def external_change(self, state: State, at: dict[str, float]) -> FloatArray:
        """Change of the external forces from a state to other values of the histories, in the unknowns."""
        change = dead_forces(self.model, self.body.points.geometry, at) - state.external
        return self.body.pattern.reduced(change)
