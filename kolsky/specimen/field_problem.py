r"""The cost of a sheet's simulation against a measured field and the force on a pad.

    J(m) = sum_k 1/2 int |u_k(m) - u_msr,k|^2 dA + w/2 sum_k (f_k(m) - f_msr,k)^2           (K.3-K.6)

of Sutula and others (2020), with its gradient by du/dm and by an adjoint (K.13-K.16), and its second
derivatives. Their w is a matter of taste. Here it makes both parts count by their noise: with one
independent point for the area a and the deviations sigma_u and sigma_f, w = a sigma_u^2 / sigma_f^2, and 2 J
/ (a sigma_u^2) is a chi-square.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix

from implicit.second import second
from implicit.sensitivity import adjoint
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.specimen.constants import Constants
from kolsky.specimen.sheet import Sheet, SheetState, mass_matrix, sheet_state

DIFFERENCE = 1e-4
"""Relative step of the differences of the gradient that give its second derivatives."""


@dataclass(frozen=True)
class FieldData:
    """A measured field on the nodes of a mesh, and the pad's motion and force."""

    pad: FloatArray
    """Displacement of the moving pad [m], shape [n]."""
    force: FloatArray
    """Force on it [N], shape [n]."""
    displacements: FloatArray
    """Measured displacements at the nodes [m], shape [n, nodes, 2]; zero where there are none."""
    cells: BoolArray
    """Cells inside the measured region, shape [m]."""
    sigma_displacement: float
    """Standard deviation of a point's displacement [m]."""
    sigma_force: float
    """Standard deviation of a force [N]."""
    area: float
    """Area of one independent point [m^2]."""

    @property
    def weight(self) -> float:
        """w of Eq. (K.6) [m^4/N^2]."""
        return self.area * self.sigma_displacement**2 / self.sigma_force**2

    def only(self, step: int) -> "FieldData":
        """The data of one step."""
        chosen = slice(step, step + 1)
        return FieldData(
            self.pad[chosen],
            self.force[chosen],
            self.displacements[chosen],
            self.cells,
            self.sigma_displacement,
            self.sigma_force,
            self.area,
        )


@dataclass(frozen=True)
class Cost:
    """The cost and its derivatives at some constants."""

    displacement: FloatArray
    """1/2 int |u - u_msr|^2 of each step [m^4], shape [n]."""
    force: FloatArray
    """1/2 (f - f_msr)^2 of each step [N^2], shape [n]."""
    value: float
    """J [m^4]."""
    gradients: FloatArray
    """dJ/dm of each step, shape [n, p]."""
    curvature_displacement: FloatArray
    """int du/dm_I . du/dm_J of all steps [m^4 per unit], shape [p, p]."""
    curvature_force: FloatArray
    """w df/dm_I df/dm_J of all steps, shape [p, p]."""
    state: SheetState
    """The simulation."""

    @property
    def gauss_newton(self) -> FloatArray:
        """Second derivatives of J without those of u and f, shape [p, p]."""
        return self.curvature_displacement + self.curvature_force


class FieldProblem:
    """A sheet, its data and what is free."""

    def __init__(self, sheet: Sheet, data: FieldData, constants: Constants) -> None:
        self.sheet, self.data, self.constants = sheet, data, constants

    @cached_property
    def mass(self) -> csr_matrix:
        """Mass matrix of the measured region, one component, shape [nodes, nodes]."""
        return mass_matrix(self.sheet.mesh, self.data.cells)

    def cost(self, free: FloatArray) -> Cost | str:
        """Eqs. (K.3-K.6) with derivatives from du/dm, or why there are none."""
        state = sheet_state(self.sheet, self.constants, free, self.data.pad)
        if isinstance(state, str):
            return state
        data, w = self.data, self.data.weight
        apart = state.displacements - data.displacements
        loaded = np.stack([self.mass @ one for one in apart])
        misfit = state.force - data.force
        moved = np.stack([[self.mass @ one for one in by] for by in state.by_constants])
        gradients = np.einsum("nai,npai->np", loaded, state.by_constants)
        gradients += w * misfit[:, None] * state.force_by_constants
        curvature = np.einsum("npai,nqai->pq", moved, state.by_constants)
        by_force = w * state.force_by_constants.T @ state.force_by_constants
        displacement = 0.5 * np.einsum("nai,nai->n", loaded, apart)
        force = 0.5 * misfit**2
        value = float(displacement.sum() + w * force.sum())
        return Cost(displacement, force, value, gradients, curvature, by_force, state)

    def adjoint_gradient(self, cost: Cost) -> FloatArray:
        """dJ/dm by one transposed system a step, Eqs. (K.13-K.16), shape [p]; of reactions."""
        apart = cost.state.displacements - self.data.displacements
        loaded = np.stack([self.mass @ one for one in apart])
        by_forces = np.zeros_like(loaded)
        moving = self.sheet.mesh.nodes(self.sheet.moving)
        misfit = self.data.weight * (cost.state.force - self.data.force)
        by_forces[:, moving, self.sheet.axis] = misfit[:, None]
        own = adjoint(cost.state.solution, loaded, by_forces)[0]
        free = self.constants.start
        return np.asarray(own @ self.constants.chain(free))

    def hessian(self, free: FloatArray) -> FloatArray:
        """Second derivatives of J, those of u and f included, shape [p, p].

        They are exact (`implicit.second`); with the force from tractions, whose second derivatives are not
        known, they are differences of the gradient.

        Raises
        ------
        ValueError
            If a simulation fails.
        """
        if self.sheet.force_from == "tractions":
            return self._by_differences(free)
        cost = self.cost(free)
        if isinstance(cost, str):
            raise ValueError(f"second derivatives need a simulation: {cost}")
        state, data = cost.state, self.data
        twice = second(state.slopes)
        chain, bent = self.constants.chain(free), self.constants.chain_changes(free)
        own = len(chain)  # region 0 comes first
        # of u and f by the energy's constants, then by what is fitted
        u_pq, u_p = twice.displacements[:, :own, :own], state.slopes.displacements[:, :own]
        u_ij = np.einsum("npqad,pi,qj->nijad", u_pq, chain, chain, optimize=True)
        u_ij += np.einsum("npad,pij->nijad", u_p, bent)
        axis, moving = self.sheet.axis, self.sheet.moving
        f_pq = twice.reaction(moving)[:, :own, :own, axis]
        f_p = state.slopes.reaction(moving)[:, :own, axis]
        f_ij = np.einsum("npq,pi,qj->nij", f_pq, chain, chain) + np.einsum("np,pij->nij", f_p, bent)
        loaded = np.stack([self.mass @ one for one in state.displacements - data.displacements])
        left = np.einsum("nad,nijad->ij", loaded, u_ij)
        left += data.weight * np.einsum("n,nij->ij", state.force - data.force, f_ij)
        return np.asarray(cost.gauss_newton + left)

    def _by_differences(self, free: FloatArray) -> FloatArray:
        """Second derivatives of J by differences of its gradient."""
        columns = []
        for j in range(len(free)):
            step = DIFFERENCE * max(abs(free[j]), 1e-3)
            ends = []
            for sign in (1.0, -1.0):
                moved = free.copy()
                moved[j] += sign * step
                found = self.cost(moved)
                if isinstance(found, str):
                    raise ValueError(f"second derivatives need a simulation beside the optimum: {found}")
                ends.append(found.gradients.sum(axis=0))
            columns.append((ends[0] - ends[1]) / (2.0 * step))
        whole = np.stack(columns)
        return np.asarray(0.5 * (whole + whole.T))
