"""The shot open-01 toward nu = 1/2: direct runs, and fine meshes corrected on coarse ones."""

from dataclasses import dataclass, replace
from functools import cache
from time import process_time

import numpy as np
import which_element_runs as runs
from dynamic_bonded import low_pass
from numpy.typing import NDArray
from scene import rms
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import minimize_scalar
from which_element_runs import CUTOFF, TRUTH, Mesh

from explicit import (
    NearlyIncompressible,
    Response,
    Samples,
    Stepping,
    cylinder,
    run,
    run_nearly_incompressible,
)
from explicit.incompressible import COMPRESSIBLE
from kolsky.inverse.forward import Numerics
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict

FloatArray = NDArray[np.float64]

POISSON = (0.49, 0.495, 0.499, 0.4999)
"""Poisson's ratios of the study of steps and time [-]."""
STUDY: Mesh = (16, 22)
"""Its mesh."""
TARGETS = (0.4999, 0.49999)
"""Nearly incompressible ratios [-]."""
FINE: tuple[Mesh, ...] = ((16, 22), (24, 32), (32, 44), (48, 64))
"""Corrected meshes."""
CASES: dict[Mesh, tuple[Mesh, Mesh]] = {
    mesh: (half.mesh, less.mesh) for mesh in FINE for half, less in [Numerics(mesh=mesh).coarser()]
}
"""Fine mesh and the two of the correction, as `kolsky` takes them."""
LADDER: tuple[Mesh, ...] = ((8, 11), (12, 16), (16, 22))
"""Coarse meshes under the fine one of 32 × 44: what the error of the correction converges with."""
FACTORS = TRUTH + 0.006 * np.arange(-1, 7)
"""Stiffness factors of the batch in which m is identified [-]."""
IDENTIFIED: Mesh = (24, 32)
"""Mesh on which m is identified."""


def samples(poisson: float, factors: FloatArray | float = TRUTH) -> Samples:
    """The shot's parameters with another Poisson's ratio."""
    model = runs.shot().forward.shot.model
    return Samples.of(stiffness_factor=factors, poisson=poisson, damping=model.damping)


@cache
def direct(mesh: Mesh, poisson: float, *, batch: bool = False) -> Response:
    """A direct run, or the batch of `FACTORS`."""
    forward = runs.shot().forward
    given = samples(poisson, FACTORS if batch else TRUTH)
    response = run(forward.model(Numerics(mesh=mesh)), given, replace(forward.sampling, ledger_every=16))
    assert response.completed.all()
    return response


@cache
def corrected(
    mesh: Mesh, coarse: tuple[Mesh, Mesh], poisson: float, *, batch: bool = False
) -> NearlyIncompressible:
    """The run on the fine mesh at nu = 0.495, corrected to another ratio."""
    forward = runs.shot().forward
    return run_nearly_incompressible(
        forward.model(Numerics(mesh=mesh)),
        (forward.mesh(Numerics(mesh=coarse[0])), forward.mesh(Numerics(mesh=coarse[1]))),
        samples(poisson, FACTORS if batch else TRUTH),
        replace(forward.sampling, ledger_every=16),
    )


def smooth(force: FloatArray) -> FloatArray:
    """The 5 kHz part of a force [N]."""
    return low_pass(force, CUTOFF)


def force_difference(mesh: Mesh, poisson: float, coarse: tuple[Mesh, Mesh] | None) -> FloatArray:
    """Transmission force minus the direct run's [N], raw; of the compressible run where `coarse` is None."""
    found = direct(mesh, COMPRESSIBLE) if coarse is None else corrected(mesh, coarse, poisson).response
    return np.asarray(found.force_transmission[0] - direct(mesh, poisson).force_transmission[0])


def radius_difference(mesh: Mesh, poisson: float, coarse: tuple[Mesh, Mesh] | None) -> FloatArray:
    """Radii of the surface minus the direct run's [m]; of the compressible run where `coarse` is None."""
    found = direct(mesh, COMPRESSIBLE) if coarse is None else corrected(mesh, coarse, poisson).response
    return np.asarray(found.surface_r[0] - direct(mesh, poisson).surface_r[0])


@dataclass(frozen=True)
class Correction:
    """A corrected run beside the direct one."""

    cost: float
    """Element steps over those of the fine mesh at nu = 0.495 [-]."""
    direct_cost: float
    """The same of the direct run [-]."""
    force: tuple[float, float, float]
    """5 kHz force, rms: error at nu = 0.495, error corrected, estimate [N]."""
    raw: tuple[float, float, float]
    """The same of the raw force [N]."""
    radius: tuple[float, float, float]
    """The same of the surface's radii [m]."""


@cache
def correction(mesh: Mesh, poisson: float, coarse: tuple[Mesh, Mesh] | None = None) -> Correction:
    """Compare a corrected run with the direct one; `coarse` is that of `CASES` by default."""
    coarse = coarse or CASES[mesh]
    found = corrected(mesh, coarse, poisson)
    errors = [force_difference(mesh, poisson, which) for which in (None, coarse)]
    radii = [radius_difference(mesh, poisson, which) for which in (None, coarse)]
    forces = (*errors, found.force_change[0])
    return Correction(
        cost=float(found.cost[0]),
        direct_cost=float(direct(mesh, poisson).steps[0] / direct(mesh, COMPRESSIBLE).steps[0]),
        force=tuple(rms(smooth(f)) for f in forces),  # type: ignore[arg-type]
        raw=tuple(rms(f) for f in forces),  # type: ignore[arg-type]
        radius=tuple(rms(r) for r in (*radii, found.radius_change[0])),  # type: ignore[arg-type]
    )


def ladder_errors(poisson: float) -> FloatArray:
    """5 kHz force errors of 32 × 44 corrected on each mesh of `LADDER`, rms [N]."""
    smaller: Mesh = (6, 8)
    return np.array([correction((32, 44), poisson, (mesh, smaller)).force[1] for mesh in LADDER])


def identified(response: Response) -> float:
    """The stiffness factor of least joint chi-square of a batch of `FACTORS` [-].

    Noise and discrepancy weigh as in `kolsky identify`: with the noise alone the ringing, which at another nu
    than the shot's has another frequency, would be all that counts.
    """
    found = predict(response, runs.shot().observations)
    objective = Objective(runs.shot().observations, found.inside.all(axis=0))
    vectors = objective.vectors(found)
    for _ in range(3):
        costs = objective.chi2(vectors)
        objective = objective.with_discrepancy(vectors[int(np.argmin(costs))])
    between = BarycentricInterpolator(FACTORS, objective.chi2(vectors))
    bounds = (float(FACTORS[0]), float(FACTORS[-1]))
    return float(minimize_scalar(lambda m: float(between(m)), bounds=bounds, method="bounded").x)


def extrapolated_difference(poisson: float) -> FloatArray:
    """What does not work: 0.495 and 0.499 on `STUDY` carried on in 1 - 2 nu, minus the direct force [N]."""
    low, high = (direct(STUDY, nu).force_transmission[0] for nu in (0.495, 0.499))
    share = (poisson - 0.499) / (0.499 - 0.495)
    return np.asarray(high + share * (high - low) - direct(STUDY, poisson).force_transmission[0])


@cache
def processor_time(poisson: float, n_samples: int) -> float:
    """Processor time of a batch of equal runs on `STUDY`, best of 5 [s]."""
    forward = runs.shot().forward
    model = forward.model(Numerics(mesh=STUDY))
    given = samples(poisson, np.full(n_samples, TRUTH))
    seconds = []
    for _ in range(5):
        start = process_time()
        run(model, given, replace(forward.sampling, ledger_every=16), threads=1)
        seconds.append(process_time() - start)
    return min(seconds)


@cache
def limited(max_steps: int) -> NearlyIncompressible:
    """A small case in which the stiff run of the correction may use up its steps before its end."""
    forward = runs.shot().forward
    model = replace(
        forward.model(Numerics(mesh=(6, 8))), mesh=cylinder(4.75e-3, 6.5e-3, n_radial=6, n_axial=8)
    )
    meshes = (
        cylinder(4.75e-3, 6.5e-3, n_radial=5, n_axial=6),
        cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=5),
    )
    stepping = Stepping(max_steps=max_steps)
    return run_nearly_incompressible(model, meshes, samples(0.49999), forward.sampling, stepping=stepping)
