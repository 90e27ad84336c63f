"""Constants of chosen laws from a compression test with held or sliding ends (inverse finite elements)."""

from dataclasses import replace

import numpy as np

from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.material.curves.band import CurveBand
from kolsky.material.end_friction.correct import tested
from kolsky.material.end_friction.fits import (
    FitFailedError,
    Found,
    bic,
    described,
    fit_candidate,
    fit_nodes,
    weighed,
)
from kolsky.material.end_friction.problem import CorrectionNumerics, EndFriction, MeasuredSpecimen, ModelFit
from kolsky.material.end_friction.refine import mesh_share, on_refined_mesh
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
    near = fit_nodes(test, continuations=("exponential",))[0]
    found: list[Found] = []
    failed: list[ModelFit] = []
    for candidate in candidates(laws):
        try:
            found.append(fit_candidate(test, candidate, near))
        except FitFailedError as error:
            failed.append(ModelFit.without(candidate.name, str(error)))
    if not found:
        raise ValueError("; ".join(f"{one.name}: {one.reason}" for one in failed))
    found, test = on_refined_mesh(found, test, near=np.inf)
    weights, criteria = weighed(found, test), bic(found, test)
    made = []
    for one, weight, criterion in zip(found, weights, criteria, strict=True):
        if one.mesh is None:
            failed.append(ModelFit.without(one.model.name, "it has no equilibrium on the refined mesh"))
            continue
        row = described(one, test, band.strain, float(weight), float(criterion))
        change = mesh_change(one, test)
        share = mesh_share(test.numerics)
        before = described(replace(one, theta=one.theta - change), test, band.strain, 0.0, 0.0).constants
        sigma = {
            name: float(np.hypot(row.sigma[name], share * (value - before[name])))
            for name, value in row.constants.items()
        }
        made.append(replace(row, sigma=sigma))
    return (*sorted(made, key=lambda one: -one.weight), *failed)


def mesh_change(one: Found, test: MeasuredSpecimen) -> FloatArray:
    """Change of the unknowns from the coarse to the refined mesh [-], shape [n]."""
    assert one.mesh is not None
    rows = one.mesh.stress / test.noise
    if test.bulge is not None:
        rows = np.append(rows, one.mesh.bulge / test.bulge_scale)
    return np.asarray(-one.gain[:, : rows.size] @ rows)
