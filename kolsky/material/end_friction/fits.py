"""Laws fitted by inverse finite elements to a compression test with end friction, on two meshes."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from kolsky.base.arrays import FloatArray
from kolsky.material.end_friction.compression import Compression
from kolsky.material.end_friction.problem import (
    CONTINUATIONS,
    Continuation,
    CorrectionNumerics,
    CurveModel,
    LibraryModel,
    MeasuredSpecimen,
    ModelFit,
    NodesModel,
    measure,
)
from kolsky.material.fits.compare import Candidate
from kolsky.material.fits.fit import fit_law
from kolsky.material.fits.homogeneous import Mode
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.search import Residuals, Weighting
from kolsky.material.uniaxial import gaussian_strain

TOLERANCE = 1e-3
"""Relative change of unknowns or of the sum of squares at which a fit ends."""
_EVALUATIONS = 12
"""Largest number of simulated tests in the search of one fit."""
NODES = (5, 7, 10)
"""Numbers of nodes. They are tried in this order until the residual is noise."""
NOISE_LEFT = 1.5
"""Largest mean square residual that is accepted as noise, divided by that of noise and mesh error [-]."""
_UNUSABLE = 1e3
"""Residual for unknowns without a valid law or without an equilibrium."""
_START_FRICTION = 0.3
"""First value in the search for a free coefficient [-]."""


@dataclass(frozen=True)
class ModelOptimum:
    """An optimum of one model."""

    model: CurveModel
    theta: FloatArray
    """Unknowns, and ln f if the friction is free, shape [n]."""
    made: Compression
    """The test simulated with these unknowns."""
    jacobian: FloatArray
    """Derivatives of residuals and prior by the unknowns, shape [n_rows, n]."""
    chi2: float
    """Sum of squared residuals of the test [-]."""
    off: FloatArray
    """ln of simulated over measured stress [-], shape [n]."""
    mesh: Compression | None = None
    """The test simulated on the refined mesh with the unknowns of `made`, if the fit was moved to it."""

    @property
    def mesh_change(self) -> FloatArray:
        """ln of the stress on the refined mesh divided by that on the coarse one [-], shape [n]."""
        assert self.mesh is not None
        return np.asarray(np.log(self.mesh.stress / self.made.stress))

    @property
    def gain(self) -> FloatArray:
        """Change of the unknowns by a change of the residuals' data, shape [n, n_rows]."""
        return np.asarray(np.linalg.pinv(self.jacobian))

    @property
    def misfit(self) -> float:
        """Root mean square of (simulated over measured stress) minus 1 [-]."""
        return float(np.sqrt(np.mean(self.off**2)))


def fit_model(test: MeasuredSpecimen, model: CurveModel, start: FloatArray) -> ModelOptimum:
    """Least squares of a model, with derivatives of the simulated test."""
    runs: dict[bytes, Compression | None] = {}
    why = ""

    def run(theta: FloatArray) -> Compression | None:
        nonlocal why
        key = theta.tobytes()
        if key not in runs:
            try:
                made = test.simulate(model, theta)
                runs[key] = made if (made.stress > 0.0).all() else None
            except ValueError as error:
                runs[key], why = None, str(error)
        return runs[key]

    def residual(theta: FloatArray) -> FloatArray:
        made, prior = run(theta), model.prior(test.own(theta))[0]
        if made is None:
            n = test.strain.size * (1 if test.bulge is None else 2)
            return np.full(n + prior.size, _UNUSABLE)
        return np.append(test.residual(made), prior)

    def jacobian(theta: FloatArray) -> FloatArray:
        made = run(theta)
        assert made is not None
        prior = model.prior(test.own(theta))[1]
        prior = np.hstack([prior, np.zeros((len(prior), theta.size - prior.shape[1]))])
        return np.vstack([test.jacobian(made, theta), prior])

    low, high = model.bounds
    if test.free:
        low, high = np.append(low, np.log(1e-3)), np.append(high, np.log(10.0))
    if run(start) is None:
        raise ValueError(f"its start has no equilibrium: {why}")
    limits: dict[str, Any] = {
        "bounds": (low, high),
        "xtol": TOLERANCE,
        "ftol": TOLERANCE,
        "max_nfev": _EVALUATIONS,
    }
    end = least_squares(residual, start, jac=jacobian, **limits)
    made = run(end.x)
    assert made is not None
    chi2 = float(np.sum(test.residual(made) ** 2))
    off = np.log(made.stress / test.stress)
    return ModelOptimum(model, np.asarray(end.x), made, jacobian(end.x), chi2, off)


def fit_nodes(
    test: MeasuredSpecimen, *, continuations: tuple[Continuation, ...] = CONTINUATIONS
) -> list[ModelOptimum]:
    """Curves with as many nodes as needed to reduce the residual to noise, with every continuation."""
    last = float(measure(test.strain[-1]))
    quotient = np.log(test.stress / gaussian_strain(test.strain, compression=True)) - np.log(1.2)
    found: list[ModelOptimum] = []
    reasons = ""
    for count in NODES:
        places = np.linspace(0.0, last, count)
        # The start is a straight line in I1 through the apparent curve, because the bends of the curve are
        # not the material's.
        start = np.polynomial.Polynomial.fit(measure(test.strain) ** 2, quotient, 2)(places**2)
        if test.free:
            start = np.append(start, np.log(_START_FRICTION))
        found = []
        for continuation in continuations:
            if found:
                start = found[-1].theta
            try:
                found.append(fit_model(test, NodesModel(places, continuation), start))
            except ValueError as error:
                reasons = str(error)
        if found and min(one.chi2 for one in found) < NOISE_LEFT * test.strain.size:
            break
    if not found:
        raise ValueError(reasons)
    return found


def fit_candidate(test: MeasuredSpecimen, candidate: Candidate, near: ModelOptimum) -> ModelOptimum:
    """Fit of a law of the library. It starts from the law's fit to the curve of another law."""
    stress = near.model.stress(test.own(near.theta), test.strain)
    homogeneous = HomogeneousTest("the curve of nodes", Mode.UNIAXIAL, 1.0 - test.strain, -stress)
    residuals = Residuals(candidate.law, (homogeneous,), held=candidate.held)
    model = LibraryModel(candidate.name, residuals)
    why = ""
    for bounded in (False, True):
        try:
            choices: dict[str, Any] = {"weighting": Weighting.RELATIVE, "held": candidate.held, "starts": 4}
            first = fit_law(candidate.law, [homogeneous], bounded=bounded, **choices)
            start = np.array([first.values[name] for name in model.names]) / model.units
            if test.free:
                start = np.append(start, near.theta[-1])
            return fit_model(test, model, start)
        except ValueError as error:
            why = str(error)
    raise ValueError(why)


def model_weights(found: list[ModelOptimum], test: MeasuredSpecimen) -> FloatArray:
    """Weights of the models: exp(-BIC / 2), Eq. (N.2).

    With n residuals, k unknowns and S = chi2, the criterion is S / v + k ln n, where v = max(1, S_best / (n -
    k)): the noise is that of the best model's misfit if it is larger.
    """
    criteria = bic(found, test)
    likelihood = np.exp(-0.5 * (criteria - criteria.min()))
    return np.asarray(likelihood / likelihood.sum())


def bic(found: list[ModelOptimum], test: MeasuredSpecimen) -> FloatArray:
    """Schwarz's criterion of each model, Eq. (N.2), shape [n_models]."""
    n = test.strain.size * (1 if test.bulge is None else 2)
    chi2 = np.array([one.chi2 for one in found])
    unknowns = np.array([one.theta.size for one in found])
    best = int(np.argmin(chi2 + unknowns * np.log(n)))
    scale = max(1.0, chi2[best] / (n - unknowns[best]))
    return np.asarray(chi2 / scale + unknowns * np.log(n))


def model_fit(
    one: ModelOptimum, test: MeasuredSpecimen, strain: FloatArray, weight: float, criterion: float
) -> ModelFit:
    """A model's fit with its constants, their uncertainties and its curve at some strains."""
    theta = test.own(one.theta)
    n = test.strain.size
    excess = max(1.0, one.chi2 / max(1, n - one.theta.size))
    length = np.linalg.norm(one.jacobian, axis=0)
    moves = length > 0.0
    size = np.where(moves, length, 1.0)
    scaled = one.jacobian / size
    # Columns are scaled to length 1. Moduli and limits of stretch may differ by ten orders, and `pinv` would
    # drop the smaller ones.
    covariance = np.linalg.pinv(scaled.T @ scaled) * excess / np.outer(size, size)
    if isinstance(one.model, LibraryModel):
        names, units, values = one.model.names, one.model.units, theta * one.model.units
    else:
        places = measure(test.strain[-1]) * np.linspace(0.0, 1.0, theta.size)
        names, values = tuple(f"2U' at s = {s:.3g}" for s in places), np.exp(theta)
        units = values
    sigma = np.sqrt(np.diag(covariance))[: theta.size]
    size = np.where(sigma > 0.0, sigma, 1.0)
    sigma = np.where(moves[: theta.size], sigma, np.inf)
    return ModelFit(
        name=one.model.name,
        constants=dict(zip(names, map(float, values), strict=True)),
        sigma=dict(zip(names, map(float, sigma * units), strict=True)),
        correlation=covariance[: theta.size, : theta.size] / np.outer(size, size),
        stress=one.model.stress(theta, strain),
        misfit=one.misfit,
        bic=criterion,
        weight=weight,
    )


ORDER, SHARE = 2.0, 0.5 * 1.25
"""Order of the mesh error, and the share of it that is the standard uncertainty, as in
`kolsky.identification`."""
NEAR = 10.0
"""Mean square residual on the coarse mesh up to which a law is moved [-]. It is divided by that of the
nearest law, or by 1. It is about three times the error of the mesh: a law with a larger misfit does not fit
on another mesh either."""
LEAST_SINGULAR_VALUE = 1e-4
"""Smallest singular value, divided by the largest, of the derivatives in a direction in which a law is moved
[-]. A test with an accuracy of a few parts in a thousand cannot resolve smaller ones."""


def on_refined_mesh(
    found: Sequence[ModelOptimum], test: MeasuredSpecimen, *, near: float = NEAR
) -> tuple[list[ModelOptimum], MeasuredSpecimen]:
    """The fits with the refined mesh's force, and the test with its noise.

    A law keeps its fit in three cases: its misfit is large, it has no equilibrium on the refined mesh, or the
    step would make its stress negative.
    """
    limit = near * max(test.strain.size, min(one.chi2 for one in found))
    simulated = []
    for one in found:
        fine = None
        if one.chi2 <= limit:
            with suppress(ValueError):  # no equilibrium on the refined mesh
                fine = test.simulate(one.model, one.theta, refined=True, derivatives=False)
        simulated.append(replace(one, mesh=fine))
    changes = [one.mesh_change for one in simulated if one.mesh is not None]
    finer = test.refined(mesh_share(test.numerics) * local_rms(changes)) if changes else test
    return [_refined_fit(one, test, finer) for one in simulated], finer


def mesh_share(numerics: CorrectionNumerics) -> float:
    """Standard uncertainty of the refined mesh as a share of the change from the coarse to the refined
    mesh.
    """
    return SHARE / ((numerics.refined_mesh[0] / numerics.mesh[0]) ** ORDER - 1.0)


def local_rms(changes: Sequence[FloatArray]) -> FloatArray:
    """Root mean square of some laws' changes, at each strain with its two neighbours, shape [n].

    If the side comes into contact element by element, the change has alternating signs and no order of
    convergence. Only its size is therefore used.
    """
    square = np.mean(np.square(changes), axis=0)
    padded = np.pad(square, 1, mode="edge")
    return np.asarray(np.sqrt((padded[:-2] + padded[1:-1] + padded[2:]) / 3.0))


def _refined_fit(one: ModelOptimum, test: MeasuredSpecimen, finer: MeasuredSpecimen) -> ModelOptimum:
    """One fit moved to the refined mesh, if it was simulated there."""
    n = test.strain.size
    coarse = replace(one, chi2=float(np.sum(finer.residual(one.made) ** 2)), mesh=None)
    if one.mesh is None:
        return coarse
    residual = finer.residual(one.mesh)
    jacobian = one.jacobian.copy()
    jacobian[:n] *= (test.noise / finer.noise)[:, None]
    prior = one.model.prior(test.own(one.theta))[0]
    theta = one.theta - np.linalg.pinv(jacobian, rcond=LEAST_SINGULAR_VALUE) @ np.append(residual, prior)
    m = test.own(theta).size
    theta[:m] = np.clip(theta[:m], *one.model.bounds)
    if not (one.model.stress(test.own(theta), test.strain) > 0.0).all():
        return coarse
    residual = residual + jacobian[: residual.size] @ (theta - one.theta)
    return replace(
        one, theta=theta, jacobian=jacobian, chi2=float(np.sum(residual**2)), off=residual[:n] * finer.noise
    )
