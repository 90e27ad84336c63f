r"""Second derivatives of equilibria by the constants.

With r(u, p) = 0 differentiated twice,

    K u_pq = -G_pq,   G_pq = D_q (K u_p + dr/dp),                                              (S.3)

where D_q is the derivative along (u_q, e_q) at fixed u_p. D_q is taken as a difference of four points of the
exact first derivatives, which leaves an error of about 1e-11. The forces of the points follow with their own
tangent.
"""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from implicit.equations import Equations, State
from implicit.sensitivity import Sensitivities, state_of

STEP = 1e-3
"""Distance of the four points, as a share of the constant [-]."""
WEIGHTS = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))
"""Steps and weights of the difference."""


@dataclass(frozen=True)
class SecondDerivatives:
    """Second derivatives of a solution; steps that were not reached hold NaN."""

    displacements: FloatArray
    """d2u/dp dq [m per unit squared], shape [n_steps, n, n, n_points, d] of n constants."""
    forces: FloatArray
    """Those of `implicit.solution.Solution.forces` [N per unit squared], of the same shape."""
    sensitivities: Sensitivities
    """The first derivatives."""

    def reaction(self, where: str) -> FloatArray:
        """Second derivatives of `implicit.solution.Solution.reaction`, shape [n_steps, n, n, d]."""
        mesh = self.sensitivities.solution.model.mesh
        return np.asarray(self.forces[:, :, :, mesh.nodes(where)].sum(axis=3))


def second(sensitivities: Sensitivities) -> SecondDerivatives:
    """Second derivatives by the constants of every region.

    Raises
    ------
    ValueError
        If the model has a contact, whose points may come and go, or `sensitivities` include a history.
    """
    solution = sensitivities.solution
    model, table = solution.model, solution.parameters
    equations = Equations(model, table)
    n = table.size
    if equations.contacts or equations.surfaces:
        raise ValueError(
            "second derivatives of a model with contact are not defined where a point comes or goes"
        )
    if len(sensitivities.names) != n:
        raise ValueError("second derivatives are by the constants: call direct without histories")
    shape = (len(solution.displacements), n, n, *model.mesh.points.shape)
    u2, f2 = np.full(shape, np.nan), np.full(shape, np.nan)
    for step in range(solution.reached):
        state = state_of(equations, solution, step)
        first = sensitivities.displacements[step].reshape(n, -1)
        change = np.zeros((n, *first.shape))
        for q in range(n):
            h = STEP * max(abs(table.flat[q]), STEP)
            for at, weight in WEIGHTS:
                moved = table.copy()
                moved.flat[q] += at * h
                along = _along(Equations(model, moved), state, state.u + at * h * first[q], first)
                change[q] += weight / h * along
        # both orders of p and q are the same derivative
        change = 0.5 * (change + change.swapaxes(0, 1)).reshape(n, n, -1)
        elements = equations.stiffness(state)
        right = equations.reduced(change).reshape(n * n, -1)
        moved = equations.expanded(equations.factors(elements).solve(-right.T).T)
        forces = change.reshape(n * n, -1) + equations.times(elements, moved)
        u2[step], f2[step] = moved.reshape(shape[1:]), forces.reshape(shape[1:])
    return SecondDerivatives(u2, f2, sensitivities)


def _along(equations: Equations, like: State, u: FloatArray, first: FloatArray) -> FloatArray:
    """K u_p + df/dp at displacements u, shape [n, n d]."""
    state = equations.evaluate(u, like.at, like=like)
    own = equations.body.forces_by_parameters(state.body)
    return own + equations.times(equations.stiffness(state), first)
