"""The budget of every route, and of the difference of force and outline, by each one's own linear map.

A source moves the force's optimum by one amount and the outline's by another. What it does to their
difference is told by the difference of the two maps, not by what it does to the joint answer: a source that
moves both alike cannot make them disagree.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.estimates import RouteOptimum
from kolsky.inverse.front_noise import replicate_uncertainty
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.result import Contribution, Route, RouteDifference
from kolsky.uncertainty.input_noise import InputChanges
from kolsky.uncertainty.numerical import MeshChange, numerical_parts

RESIDUALS = "force and shape"
"""Name of the part that comes from the residuals."""
DECLARED = "declared inputs"
"""Name of the part that comes from [uncertainty] of the shot file."""


@dataclass(frozen=True)
class Sources:
    """Everything that moves an optimum, as changes of the data vector."""

    inputs: InputChanges
    """Noise and scales of the inputs."""
    mesh: MeshChange
    """Mesh and element."""
    deviations: FloatArray | None = None
    """What a run deviates from the model of a rough response (`RefinedOptimum.deviations`), shape [n, k];
    each route, and the difference of two, makes of them what its own map does."""
    declared: FloatArray | None = None
    """Changes by what shot.toml declares uncertain, their mean square the sum over the keys, shape [n, k];
    the joint answer counts these by itself, `Estimate.sigma_systematic`."""

    def roughness(self, gain: FloatArray) -> FloatArray | None:
        """Standard deviation of an optimum from the response's roughness, shape [d]; None if it is smooth."""
        if self.deviations is None:
            return None
        return np.asarray(np.sqrt(np.sum((self.deviations @ gain.T) ** 2, axis=0)))

    def parts(
        self, residual: FloatArray, gain: FloatArray, gains: Sequence[FloatArray] | None = None
    ) -> dict[str, FloatArray]:
        """Standard uncertainties by source, shape [d] each.

        Parameters
        ----------
        residual
            Covariance from the residuals, shape [d, d].
        gain, gains
            As of `InputChanges.parts`.
        """
        found = {
            RESIDUALS: np.sqrt(np.diag(residual)),
            **self.inputs.parts(gain, gains),
            **numerical_parts(self.mesh, gain, roughness=self.roughness(gain)),
        }
        if self.declared is not None and len(self.declared):
            found[DECLARED] = replicate_uncertainty(self.declared @ gain.T)
        return found


def noise_parts(fine: RefinedOptimum, sources: Sources) -> dict[str, FloatArray]:
    """Standard uncertainties of the joint answer by source of noise, shape [d] each.

    A common scale counts with the steepest of the slopes that may be right.
    """
    objective, vector = fine.objective, fine.model(fine.x)[0]
    residual = objective.residual_covariance(fine.jacobian, vector)
    gains = [objective.gain(slope) for slope in fine.slopes]
    return {
        RESIDUALS: np.sqrt(np.diag(residual)),
        **sources.inputs.parts(objective.gain(fine.jacobian), gains),
    }


def combined(parts: dict[str, FloatArray]) -> FloatArray:
    """Root sum of squares of the parts, shape [d]."""
    return np.asarray(np.sqrt(np.sum([part**2 for part in parts.values()], axis=0)))


def budgeted(names: Sequence[str], optimum: RouteOptimum, sources: Sources) -> Route:
    """A route with its correction for the mesh and its budget."""
    parts = sources.parts(optimum.residual, optimum.gain)
    correction = sources.mesh.correction(optimum.gain)
    return Route(
        name=optimum.name,
        parameters=_named(names, optimum.x + correction),
        cost=optimum.cost,
        sigma=_named(names, combined(parts)),
        correction=_named(names, correction),
        budget=_contributions(names, parts),
    )


def route_difference(
    names: Sequence[str], optima: Sequence[RouteOptimum], sources: Sources
) -> RouteDifference | None:
    """Force alone minus outline alone with its own budget; None where one of them is missing.

    The residuals of the two are of different data, and their covariances add.
    """
    by_part = {optimum.part: optimum for optimum in optima}
    if not {"force", "shape"} <= set(by_part):
        return None
    force, shape = by_part["force"], by_part["shape"]
    gain = force.gain - shape.gain
    parts = sources.parts(force.residual + shape.residual, gain)
    return RouteDifference(
        values=_named(names, force.x - shape.x + sources.mesh.correction(gain)),
        sigma=_named(names, combined(parts)),
        budget=_contributions(names, parts),
    )


def _named(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, np.asarray(values).tolist(), strict=True))


def _contributions(names: Sequence[str], parts: dict[str, FloatArray]) -> tuple[Contribution, ...]:
    return tuple(Contribution(source, _named(names, sigma)) for source, sigma in parts.items())
