"""What a solution holds."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from implicit.model import Model
from implicit.outcome import Outcome


@dataclass(frozen=True)
class Solution:
    """A history of equilibria; steps that were not reached hold NaN, and the outcome says why."""

    model: Model
    """The model."""
    parameters: FloatArray
    """Constants of each region, shape [n_regions, n_parameters]."""
    steps: dict[str, FloatArray]
    """Value of each history at each step, shape [n_steps]."""
    displacements: FloatArray
    """Displacements [m], shape [n_steps, n, d]."""
    forces: FloatArray
    """Forces that supports, grips, planes and nodal loads exert on the points: the internal ones less weight
    and pressure [N], shape [n_steps, n, d]."""
    energy: FloatArray
    """Strain energy [J], shape [n_steps]."""
    outcome: Outcome
    """How it ended."""
    reached: int
    """Number of steps reached."""
    iterations: int = 0
    """Newton iterations of all steps."""
    factorisations: int = 0
    """Factorisations of all steps."""
    contact_forces: tuple[FloatArray, ...] = ()
    """Forces of the points of each rigid plane along its normal [N], each of shape [n_steps, p]."""

    def reaction(self, where: str) -> FloatArray:
        """Sum of `forces` over a set of points [N], shape [n_steps, d]."""
        return np.asarray(self.forces[:, self.model.mesh.nodes(where)].sum(axis=1))

    def mean_displacement(self, where: str) -> FloatArray:
        """Mean displacement of a set of points [m], shape [n_steps, d]."""
        return np.asarray(self.displacements[:, self.model.mesh.nodes(where)].mean(axis=1))
