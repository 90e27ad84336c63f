"""Constants of chosen laws from a compression test with held or sliding ends (inverse finite elements)."""

from dataclasses import replace

import numpy as np

from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.material.curves.band import CurveBand
from kolsky.material.end_friction.correct import ORDER, SHARE, tested
from kolsky.material.end_friction.fits import (
    FitFailedError,
    Found,
    bic,
    described,
    fit_candidate,
    moved,
    on_refined_mesh,
    weighed,
)
from kolsky.material.end_friction.problem import CorrectionNumerics, EndFriction, MeasuredSpecimen, ModelFit
from kolsky.material.fits.compare import candidates


def fit_specimen(
    band: CurveBand,
    specimen: Specimen,
    ends: EndFriction,
    laws: tuple[str, ...],
    *,
    bulge: FloatArray | None = None,
    bulge_sigma: float = 0.0,
    numerics: CorrectionNumerics | None = None,
) -> tuple[ModelFit, ...]:
    """Fit laws to a compressed cylinder, with intervals and correlations, greatest weight first.

    Levenberg and Marquardt's method (a trust region where a law has bounds) over the derivatives of the
    simulated test, on a coarse mesh; the optimum is then moved to the refined one, and a share of that change
    is in the uncertainties.

    Parameters
    ----------
    band
        Apparent nominal stress over nominal compressive strain.
    specimen
        Its undeformed size.
    ends
        What holds it at its ends.
    laws
        Names of `kolsky.material.fits.compare.candidates`.
    bulge, bulge_sigma
        Radius at mid-height [m], shape [n], and its standard deviation [m].
    numerics
        Meshes and Poisson's ratio.

    Raises
    ------
    ValueError
        If no law can be fitted; the message has each one's reason.
    """
    test = tested(band, specimen, ends, bulge, bulge_sigma, numerics or CorrectionNumerics())
    try:
        test, near = on_refined_mesh(test)
    except FitFailedError as error:
        raise ValueError(f"the cylinder cannot be simulated: {error}") from error
    found: list[Found] = []
    failed: list[ModelFit] = []
    for candidate in candidates(laws):
        try:
            found.append(fit_candidate(test, candidate, near))
        except FitFailedError as error:
            failed.append(ModelFit.without(candidate.name, str(error)))
    if not found:
        raise ValueError("; ".join(f"{one.name}: {one.reason}" for one in failed))
    weights, criteria = weighed(found, test), bic(found, test)
    made = []
    for one, weight, criterion in zip(found, weights, criteria, strict=True):
        left, whole = mesh_change(one, test)
        row = described(moved(one, left), test, band.strain, float(weight), float(criterion))
        share = SHARE / ((test.numerics.refined_mesh[0] / test.numerics.mesh[0]) ** ORDER - 1.0)
        before = described(moved(one, left - whole), test, band.strain, 0.0, 0.0).constants
        sigma = {
            name: float(np.hypot(row.sigma[name], share * (value - before[name])))
            for name, value in row.constants.items()
        }
        made.append(replace(row, sigma=sigma))
    return (*sorted(made, key=lambda one: -one.weight), *failed)


def mesh_change(one: Found, test: MeasuredSpecimen) -> tuple[FloatArray, FloatArray]:
    """Change of the unknowns to the refined mesh: what is left of it, and from the coarse one [-], shape [n]
    each."""
    error = test.mesh_error(one.model, one.theta, one.made)
    whole = -one.gain[:, : test.strain.size] @ (error.stress / test.noise)
    left = -one.gain[:, : test.strain.size] @ ((error.stress - test.shift) / test.noise)
    if test.bulge is not None:
        by_radius = one.gain[:, test.strain.size : 2 * test.strain.size] / test.bulge_scale
        whole = whole - by_radius @ error.bulge
        left = left - by_radius @ (error.bulge - test.bulge_shift)
    return np.asarray(left), np.asarray(whole)
