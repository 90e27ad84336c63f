"""First and second derivatives of equilibria by the constants, by the implicit function theorem.

At an equilibrium f_int(u, p) = f_ext the derivatives of the unknowns by the constants follow from

    K du/dp = -df_int/dp                                                                       (S.1)

(Schumacher and others 2020, Section IV-B). The forces of the points have the derivatives dF/dp = df_int/dp +
K_F du/dp, fixed points included. K_F is the tangent of F. The second derivatives follow from r(u, p) = 0,
differentiated twice:

    K u_pq = -G_pq,   G_pq = D_q (K u_p + dr/dp),                                              (S.2)

where D_q is the derivative along (u_q, e_q) at fixed u_p. It is a difference of the exact first derivatives
at two points. Its error is up to 1e-5 with a follower pressure, and 1e-7 without.
"""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from kolsky.equilibrium.equations import Equations, State
from kolsky.equilibrium.linear.base import Factors
from kolsky.equilibrium.solution import Solution


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of a solution. Steps that were not reached are NaN."""

    names: tuple[str, ...]
    """The constants, region by region, and then the requested histories."""
    displacements: FloatArray
    """du/dp [m per unit], shape [n_steps, n_names, n, d]."""
    forces: FloatArray
    """Derivatives of `kolsky.equilibrium.solution.Solution.forces` [N per unit], shape [n_steps, n_names, n,
    d]."""
    solution: Solution
    factors: tuple[Factors, ...] = ()

    def reaction(self, where: str) -> FloatArray:
        """Derivatives of `Solution.reaction` [N per unit], shape [n_steps, n_names, d]."""
        return np.asarray(self.forces[:, :, self.solution.model.mesh.nodes(where)].sum(axis=2))

    def mean_displacement(self, where: str) -> FloatArray:
        """Derivatives of `Solution.mean_displacement` [m per unit], shape [n_steps, n_names, d]."""
        return np.asarray(self.displacements[:, :, self.solution.model.mesh.nodes(where)].mean(axis=2))


def direct(solution: Solution, *, histories: tuple[str, ...] = (), keep: bool = False) -> Sensitivities:
    """Derivatives of all displacements and forces.

    There is one factorisation per step, and one solution per constant.

    ``solution``: equilibria. ``histories``: histories for which derivatives by their value at each step are
    added (such as a fitted force). ``keep``: keep the factors of every step for `second`.
    """
    model, equations, kept = solution.model, solution.equations, []
    names = (*model.parameter_names, *histories)
    shape = (len(solution.displacements), len(names), *model.mesh.points.shape)
    du, df = np.full(shape, np.nan), np.full(shape, np.nan)
    for step in range(solution.reached):
        state = state_of(equations, solution, step)
        carried = equations.carried_stiffness(state)
        elements = equations.with_contact(carried, state, held=True)
        own = equations.body.forces_by_parameters(state.body)
        explicit = np.vstack([own, np.zeros((len(histories), own.shape[1]))])
        right = equations.reduced(explicit)
        moved = np.zeros_like(explicit)
        for j, name in enumerate(histories, start=len(own)):
            moved[j], right[j] = _by_history(equations, state, elements, name)
        factors = equations.factors(elements, state)
        if keep:
            kept.append(factors)
        unknown = factors.solve(-right.T).T
        moved += equations.expanded(unknown)
        du[step] = moved.reshape(shape[1:])
        for j, name in enumerate(histories, start=len(own)):
            explicit[j] -= equations.carried_change(state, _unit_more(state, name))
        forces = explicit + equations.times(carried, moved)
        df[step] = forces.reshape(shape[1:])
    return Sensitivities(names, du, df, solution, tuple(kept))


def state_of(equations: Equations, solution: Solution, step: int) -> State:
    """The state of a step, with its tangent."""
    at = {name: float(values[step]) for name, values in solution.steps.items()}
    multipliers = tuple(forces[step] for forces in solution.contact_forces)
    return equations.evaluate(solution.displacements[step].reshape(-1), at, multipliers=multipliers)


def _by_history(
    equations: Equations, state: State, elements: FloatArray, name: str
) -> tuple[FloatArray, FloatArray]:
    """Prescribed displacements and the residual per unit of a history."""
    model = equations.model
    if name not in model.histories:
        raise ValueError(f"histories must be out of {sorted(model.histories)}, got {name!r}")
    moved = np.zeros(model.n_dofs)
    for dofs, of, factor in model.unknowns.prescribed:
        if of == name:
            moved[dofs] = factor
    full = equations.times(elements, moved)
    for contact, blocks in zip(equations.contacts, equations.contact_blocks(state, held=True), strict=True):
        if contact.surface.history == name:
            full = full - contact.by_history(blocks)
    residual = equations.reduced(full)
    return moved, residual - equations.external_change(state, _unit_more(state, name))


def _unit_more(state: State, name: str) -> dict[str, float]:
    return {**state.at, name: state.at[name] + 1.0}


STEP = 1e-4
"""Relative distance of the two points from the constant [-]. The error of the difference is its square. The
round-off of the first derivatives divided by it is 1e-11."""


@dataclass(frozen=True)
class SecondDerivatives:
    """Second derivatives of a solution. Steps that were not reached are NaN."""

    displacements: FloatArray
    """d2u/dp dq [m per unit squared], shape [n_steps, n, n, n_points, d] for n constants."""
    forces: FloatArray
    """Second derivatives of `kolsky.equilibrium.solution.Solution.forces` [N per unit squared], as above."""
    sensitivities: Sensitivities

    def reaction(self, where: str) -> FloatArray:
        """Second derivatives of `kolsky.equilibrium.solution.Solution.reaction`, shape [n_steps, n, n, d]."""
        mesh = self.sensitivities.solution.model.mesh
        return np.asarray(self.forces[:, :, :, mesh.nodes(where)].sum(axis=3))


def second(sensitivities: Sensitivities, *, first: int | None = None) -> SecondDerivatives:
    """Second derivatives by the constants of every region, or by the first ``first`` of them.

    Raises ValueError if the model has a contact, because its points may change, or if `sensitivities` include
    a history.
    """
    solution = sensitivities.solution
    model, table = solution.model, solution.parameters
    equations = solution.equations
    n = table.size if first is None else first
    if equations.contacts or equations.surfaces:
        raise ValueError(
            "second derivatives of a model with contact are not defined where a point comes or goes"
        )
    if len(sensitivities.names) != table.size:
        raise ValueError("second derivatives are by the constants: call direct without histories")
    shape = (len(solution.displacements), n, n, *model.mesh.points.shape)
    u2, f2 = np.full(shape, np.nan), np.full(shape, np.nan)
    for step in range(solution.reached):
        state = state_of(equations, solution, step)
        by = sensitivities.displacements[step, :n].reshape(n, -1)
        change = np.zeros((n, *by.shape))
        for q in range(n):
            h = STEP * max(abs(table.flat[q]), STEP)
            for side in (-h, h):
                moved = table.copy()
                moved.flat[q] += side
                along = _along(equations.with_parameters(moved), state, state.u + side * by[q], by)
                change[q] += along / (2.0 * side)
        # both orders of p and q are the same derivative
        change = 0.5 * (change + change.swapaxes(0, 1)).reshape(n, n, -1)
        elements = equations.stiffness(state)
        right = equations.reduced(change).reshape(n * n, -1)
        factors = sensitivities.factors[step] if sensitivities.factors else equations.factors(elements)
        moved = equations.expanded(factors.solve(-right.T).T)
        forces = change.reshape(n * n, -1) + equations.times(elements, moved)
        u2[step], f2[step] = moved.reshape(shape[1:]), forces.reshape(shape[1:])
    return SecondDerivatives(u2, f2, sensitivities)


def _along(equations: Equations, like: State, u: FloatArray, by: FloatArray) -> FloatArray:
    """K u_p + df/dp at displacements u, shape [n, n d]."""
    state = equations.evaluate(u, like.at, like=like)
    own = equations.body.forces_by_parameters(state.body)[: len(by)]
    return own + equations.times(equations.stiffness(state), by)
