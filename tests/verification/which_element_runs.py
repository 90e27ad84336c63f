"""The known-answer shot open-01 with every element: artificial energy, force, outline and identified m."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from dynamic_bonded import low_pass
from numpy.typing import NDArray
from richardson import limit
from scene import rms
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import minimize_scalar

from doe import Box
from explicit import Response
from kolsky.inverse.coarse_search import search
from kolsky.inverse.forward import Numerics
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction, predict
from kolsky.inverse.problem import PreparedShot, prepare_shot
from kolsky.shot.load import load_shot

FloatArray = NDArray[np.float64]
Mesh = tuple[int, int]

SHOT = Path(__file__).resolve().parents[2] / "runs" / "open-01"
TRUTH = 1.12
"""The stiffness factor that the shot was made with (truth.json) [-]."""
FORMS: dict[str, dict[str, str]] = {
    "one-point, stiffness": {"element": "one_point", "hourglass_form": "stiffness"},
    "one-point, viscous": {"element": "one_point", "hourglass_form": "viscous"},
    "F-bar": {"element": "fbar"},
}
"""Elements and hourglass forms, as the page calls them."""
MESHES: tuple[Mesh, ...] = ((16, 22), (24, 32), (32, 44), (48, 64))
COARSE: tuple[Mesh, ...] = ((8, 11), (12, 16), (16, 22))
"""Meshes of the quick tests."""
SPACING = 0.006
"""Distance of neighbouring stiffness factors of a batch [-]: data vectors between them, with all their
ringing, are interpolated by the polynomial through a batch; every other factor left out moves m by 1e-4."""
CUTOFF = 5e3
"""Cut-off of the compared force [Hz]."""
ORDER = 2.0
"""Order of the extrapolation [-]: the common fit of all elements to m has it, see the page."""
GRADINGS = (1.0, 2.0, 4.0)
"""Largest over smallest element of the study of graded meshes [-]."""


@cache
def shot() -> PreparedShot:
    """The shot ready to run."""
    return prepare_shot(load_shot(SHOT))


def factors(mesh: Mesh) -> FloatArray:
    """Stiffness factors of a batch [-]: eight on a coarse mesh, whose m is further away, else three."""
    return TRUTH + SPACING * (np.arange(-1, 7) if mesh[0] <= 24 else np.arange(-1, 2))


def middle(mesh: Mesh) -> int:
    """The simulation of a batch whose histories are compared: the true stiffness factor."""
    return int(np.argmin(np.abs(factors(mesh) - TRUTH)))


@cache
def batch(form: str, mesh: Mesh, grading: float = 2.0) -> Response:
    """The shot with `factors`, its own nu = 0.499 and damping.

    The energy ledger stands at every camera frame up to 16 elements across, else at every sixteenth.
    """
    numerics = Numerics(mesh=mesh, grading=grading, **FORMS[form])  # type: ignore[arg-type]
    response = shot().forward.run({"stiffness_factor": factors(mesh)}, numerics, all_nodes=mesh[0] <= 16)
    assert response.completed.all()
    return response


def size(mesh: Mesh) -> float:
    """Element size over the specimen's [-]: 1 / sqrt(number of elements)."""
    return float((mesh[0] * mesh[1]) ** -0.5)


def force(form: str, mesh: Mesh, grading: float = 2.0) -> FloatArray:
    """Low-passed transmitted force of the true stiffness [N], shape [n_force_times]."""
    return low_pass(batch(form, mesh, grading).force_transmission[middle(mesh)], CUTOFF)


@cache
def prediction(form: str, mesh: Mesh, grading: float = 2.0) -> Prediction:
    """What the instruments would have seen of the batch."""
    return predict(batch(form, mesh, grading), shot().observations)


def outline(form: str, mesh: Mesh, grading: float = 2.0) -> FloatArray:
    """Radius at every measured point, true stiffness [m], shape [n_points]; all lie inside."""
    return prediction(form, mesh, grading).Z[middle(mesh)]


def identified(form: str, mesh: Mesh, grading: float = 2.0, *, weights: str = "noise") -> float:
    """The stiffness factor of least joint chi-square [-].

    `weights`: "noise" takes the measured noise alone; "identify" adds the discrepancy that
    `kolsky.inverse.coarse_search.search` estimates, as `kolsky identify` does.
    """
    found = prediction(form, mesh, grading)
    assert found.inside.all()
    objective = Objective(shot().observations, found.inside.all(axis=0))
    levels = factors(mesh)
    vectors = BarycentricInterpolator(levels, objective.vectors(found), axis=0)
    bounds = (float(levels[0]), float(levels[-1]))
    if weights == "identify":
        box = Box(("stiffness_factor",), bounds[:1], bounds[1:])
        return float(search(box, objective, lambda x: vectors(np.ravel(x))).x[0])
    cost = minimize_scalar(lambda m: float(objective.chi2(vectors(m))), bounds=bounds, method="bounded")
    if not bounds[0] + 1e-4 < cost.x < bounds[1] - 1e-4:
        raise ValueError(f"m = {cost.x:.4f} lies at the edge of the batch {bounds}: widen `factors`")
    return float(cost.x)


@dataclass(frozen=True)
class Series:
    """An element's refinement series."""

    sizes: FloatArray
    """Element sizes [-], shape [n_meshes]."""
    force: FloatArray
    """Rms distance of the 5 kHz force from all elements' common limit [N], shape [n_meshes]."""
    outline: FloatArray
    """Rms distance of the radii from their common limit [m], shape [n_meshes]."""
    factor: FloatArray
    """Identified m, weighted by the noise [-], shape [n_meshes]."""
    weighted: FloatArray
    """Identified m, weighted as `kolsky identify` does [-], shape [n_meshes]."""


@dataclass(frozen=True)
class Convergence:
    """What all elements converge to, and how."""

    series: dict[str, Series]
    """By element."""
    force_limits: dict[str, FloatArray]
    """Extrapolated 5 kHz force of each element [N], shape [n_force_times]."""
    outline_limits: dict[str, FloatArray]
    """Extrapolated radii of each element [m], shape [n_points]."""


def convergence(meshes: tuple[Mesh, ...] = MESHES) -> Convergence:
    """Extrapolate each element's force and outline; the mean of the limits is what all are measured from."""
    sizes = np.array([size(mesh) for mesh in meshes])
    forces = {form: np.array([force(form, mesh) for mesh in meshes]) for form in FORMS}
    outlines = {form: np.array([outline(form, mesh) for mesh in meshes]) for form in FORMS}
    force_limits = {form: limit(sizes, values, ORDER).value for form, values in forces.items()}
    outline_limits = {form: limit(sizes, values, ORDER).value for form, values in outlines.items()}
    whole_force = np.mean(list(force_limits.values()), axis=0)
    whole_outline = np.mean(list(outline_limits.values()), axis=0)
    series = {
        form: Series(
            sizes=sizes,
            force=np.array([rms(values - whole_force) for values in forces[form]]),
            outline=np.array([rms(values - whole_outline) for values in outlines[form]]),
            factor=np.array([identified(form, mesh) for mesh in meshes]),
            weighted=np.array([identified(form, mesh, weights="identify") for mesh in meshes]),
        )
        for form in FORMS
    }
    return Convergence(series, force_limits, outline_limits)


def apart(limits: dict[str, FloatArray]) -> float:
    """Largest rms distance of two elements' limits, in their unit."""
    values = list(limits.values())
    return max(rms(a - b) for i, a in enumerate(values) for b in values[:i])


def artificial_history(form: str, mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Times [s] of the ledger, and artificial energy over the strain energy of the same instant [-]."""
    ledger = batch(form, mesh).energy
    one = middle(mesh)
    kept = np.isfinite(ledger.elastic[one]) & (ledger.elastic[one] > 0.0)
    share = ledger.artificial[one, kept] / ledger.elastic[one, kept]
    return shot().forward.sampling.surface_times[kept], share


def artificial_share(form: str, mesh: Mesh) -> float:
    """Largest artificial energy over the largest strain energy [-]."""
    return float(batch(form, mesh).energy.artificial_share()[middle(mesh)])
