"""Result of a history of equilibria, and its outcome: a named cause with its remedy."""

from dataclasses import dataclass, field

import numpy as np

from dic.outcome import Outcome as NamedOutcome
from explicit.arrays import FloatArray
from kolsky.equilibrium.equations import Equations
from kolsky.equilibrium.model import Model


class Outcome(NamedOutcome):
    """How a history of equilibria ended."""

    def require(self, what: str) -> None:
        """Raise ValueError with what was simulated, cause and cure, if not every step was reached."""
        if not self.ok:
            raise ValueError(f"{what}: {self.cause}; {self.cure}")

    COMPLETED = 0, "every step was reached", "nothing to do"
    NOT_CONVERGED = (
        1,
        "Newton's iteration found no equilibrium, however small the step was made",
        "look for buckling or a limit point of the load, prescribe displacements in place of forces, or "
        "check the constants of the law",
    )
    INVERTED = (
        2,
        "an element turned inside out (J <= 0)",
        "refine the mesh where it deforms most, or end the history earlier",
    )
    SINGULAR = (
        3,
        "the tangent stiffness is singular",
        "hold the rigid motions of every part, or look for buckling",
    )
    PENETRATION = (
        5,
        "a contact did not close within its tolerance",
        "raise the penalty or the tolerance of the contact, or take smaller steps",
    )


@dataclass(frozen=True)
class Solution:
    """A history of equilibria. Steps that were not reached are NaN, and the outcome gives the reason."""

    model: Model
    parameters: FloatArray
    """Constants of each region, shape [n_regions, n_parameters]."""
    steps: dict[str, FloatArray]
    """Value of each history at each step, shape [n_steps]."""
    displacements: FloatArray
    """Displacements [m], shape [n_steps, n, d]."""
    forces: FloatArray
    """Forces of supports, grips, rigid surfaces and nodal loads on the points [N], shape [n_steps, n, d].
    They are internal forces minus weight and pressure."""
    energy: FloatArray
    """Strain energy [J], shape [n_steps]."""
    outcome: Outcome
    reached: int
    """Number of steps reached."""
    iterations: int
    """Newton iterations of all steps."""
    factorisations: int
    """Factorisations of all steps."""
    contact_forces: tuple[FloatArray, ...]
    """Forces of the points of each rigid surface along its normal [N], each of shape [n_steps, p]."""
    equations: Equations = field(repr=False, compare=False)

    def reaction(self, where: str) -> FloatArray:
        """Sum of `forces` over a set of points [N], shape [n_steps, d]."""
        return np.asarray(self.forces[:, self.model.mesh.nodes(where)].sum(axis=1))

    def mean_displacement(self, where: str) -> FloatArray:
        """Mean displacement of a set of points [m], shape [n_steps, d]."""
        return np.asarray(self.displacements[:, self.model.mesh.nodes(where)].mean(axis=1))
