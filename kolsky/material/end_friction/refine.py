"""Fits on the coarse mesh moved to the refined one, each by what the mesh changes of its own simulated test.

The side of a barrelling cylinder lands on the platen element by element, which makes the coarse mesh's force
uneven by a few parts in a thousand. That is as much as two laws may differ by, so it must not decide between
them: every law that comes near the test is simulated once more on the refined mesh, and one step of Gauss and
Newton with the derivatives at hand takes its unknowns there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.material.end_friction.fits import Found
from kolsky.material.end_friction.problem import CorrectionNumerics, MeasuredSpecimen, MeshError

ORDER, SHARE = 2.0, 0.5 * 1.25
"""Order of the mesh error and its share that counts as standard uncertainty, as in
`kolsky.identification`."""
NEAR = 10.0
"""Mean square residual on the coarse mesh, over that of the nearest law or 1, up to which a law is moved [-].
Three times the mesh's own error: nearer than that no mesh brings a law that is farther off."""
TOLD = 1e-4
"""Least singular value of the derivatives, over the largest, of a direction in which a law is moved [-]: a
test of a few parts in a thousand does not tell less."""


def on_refined_mesh(
    found: Sequence[Found], test: MeasuredSpecimen, *, near: float = NEAR
) -> tuple[list[Found], MeasuredSpecimen]:
    """The fits with the refined mesh's force, and the test with its noise.

    A law that is not near the test, that has no equilibrium on the refined mesh, or whose stress the step
    would take below none, keeps its fit.
    """
    limit = near * max(test.strain.size, min(one.chi2 for one in found))
    errors: list[MeshError | None] = []
    for one in found:
        try:
            errors.append(test.mesh_error(one.model, one.theta, one.made) if one.chi2 <= limit else None)
        except ValueError:
            errors.append(None)
    changes = [error.stress for error in errors if error is not None]
    finer = test.refined(mesh_share(test.numerics) * locally(changes)) if changes else test
    return [
        kept_fit(one, finer) if error is None else refined_fit(one, test, finer, error)
        for one, error in zip(found, errors, strict=True)
    ], finer


def mesh_share(numerics: CorrectionNumerics) -> float:
    """Share of the change from the coarse to the refined mesh that is the latter's standard uncertainty."""
    return SHARE / ((numerics.refined_mesh[0] / numerics.mesh[0]) ** ORDER - 1.0)


def locally(changes: Sequence[FloatArray]) -> FloatArray:
    """Root mean square of some laws' changes, at each strain with its two neighbours, shape [n].

    Where the side lands an element at a time the change has either sign and no order, so that it is known by
    its size only.
    """
    square = np.mean(np.square(changes), axis=0)
    padded = np.pad(square, 1, mode="edge")
    return np.asarray(np.sqrt((padded[:-2] + padded[1:-1] + padded[2:]) / 3.0))


def refined_fit(one: Found, test: MeasuredSpecimen, finer: MeasuredSpecimen, error: MeshError) -> Found:
    """One fit moved to the refined mesh, which changes its simulated test by `error`."""
    n = test.strain.size
    rows = [(one.off + error.stress) / finer.noise]
    if test.bulge is not None:
        rows.append((one.made.bulge + error.bulge - test.bulge) / test.bulge_scale)
    residual = np.concatenate(rows)
    jacobian = weighed_again(one, test, finer)
    prior = one.model.prior(test.own(one.theta))[0]
    theta = one.theta - np.linalg.pinv(jacobian, rcond=TOLD) @ np.append(residual, prior)
    m = test.own(theta).size
    theta[:m] = np.clip(theta[:m], one.model.lower, one.model.upper)
    if not (one.model.stress(test.own(theta), test.strain) > 0.0).all():
        return kept_fit(one, finer)
    residual = residual + jacobian[: residual.size] @ (theta - one.theta)
    return replace(
        one,
        theta=theta,
        jacobian=jacobian,
        chi2=float(np.sum(residual**2)),
        evaluations=one.evaluations + 1,
        off=residual[:n] * finer.noise,
        mesh=error,
    )


def kept_fit(one: Found, finer: MeasuredSpecimen) -> Found:
    """A fit that stays on the coarse mesh, its stresses weighed as the others'."""
    rows = finer.residual(one.made)
    return replace(one, chi2=float(np.sum(rows**2)))


def weighed_again(one: Found, test: MeasuredSpecimen, finer: MeasuredSpecimen) -> FloatArray:
    """Derivatives of residuals and prior with the noise of the refined mesh, shape [n_rows, n]."""
    jacobian = one.jacobian.copy()
    n = test.strain.size
    jacobian[:n] *= (test.noise / finer.noise)[:, None]
    return jacobian
