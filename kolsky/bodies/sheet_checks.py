r"""Checks of a sheet's data against its model: points, field, force, and wrong factors.

**Points.** `kolsky.bodies.sheet.outliers` suspects points that differ from their neighbours' prediction. Near
a hole, a pad or the border of a region, the field varies within a few points, and neighbours predict badly. A
suspected point is therefore an outlier only if the fitted sheet does not predict it either. Let u_h be the
field of the mesh, e its error at the point, and s the robust deviation of all points from u_h. The point is
an outlier if

    |u - u_h| > gate s + e,     e = (h / 4) max_a |G_a - G|,                                          (P.1)

Here h is the size of the cell, G its gradient and G_a the gradient averaged over the cells at its node a. For
a parabola this is the error of a linear element (Zienkiewicz and Zhu 1987).

**Force and field** are fitted together, and each misfit is checked separately. If one is not explained, the
constants are fitted to the field alone, with the covariance C. With the force f and F = df/dm at these
constants,

    k = (f . f_msr) / (f_msr . f_msr),
    sigma_k^2 = f_msr . (F C F^T + k^2 sigma_f^2) f_msr / |f_msr|^4                                   (P.2)

is the factor missing in the measured force. A common factor k_0 is reported under two conditions. First, |k -
k_0| is at most twice sigma_k, which here includes the share that counts as explained. Second, a fit with the
force times k_0 explains both.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from dic.basics import MAD
from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.bodies.sheet_fit import (
    EXPLAINED_SHARE,
    SILENT,
    FieldData,
    FieldFit,
    FieldProblem,
    Progress,
    fit_field,
    with_other_starts,
)
from kolsky.bodies.sheet_reading import MeasuredField, keeping, mesh_scale
from kolsky.equilibrium.meshes import Mesh

_CELLS = 16
"""Number of nearest cells, by their centres, in which a point is searched."""
_INSIDE = 1e-6
"""Tolerance outside the reference cell for a point on its border, because of round-off [-]."""
_NEWTON_STEPS = 8
"""Newton steps of the inverse map. A straight cell needs one, a curved one four or five."""
_PASSES = 4
"""Maximum number of fits with readmitted points."""
STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2]."""
FORCE_FACTORS = {
    -1.0: "its sign is reversed",
    1e3: "its unit is 1000 times larger, as N for mN",
    1e-3: "its unit is 1000 times smaller, as mN for N",
    2.0: "it is that of half of the sheet",
    0.5: "it is that of two sheets",
    STANDARD_GRAVITY: "it is in kgf or kg, not in N",
    1e-3 * STANDARD_GRAVITY: "it is in gf or g, not in N",
    1.0 / STANDARD_GRAVITY: "it was multiplied by the acceleration of gravity once too often",
}
"""Factor missing in the measured force -> the error that explains it."""
FIELD_FACTORS = {
    -1.0: "their sign is reversed",
    1e3: "their unit is 1000 times larger, as mm for µm",
    1e-3: "their unit is 1000 times smaller, as µm for mm",
}
"""Factor missing in the points' displacements -> the error that explains it."""


def interpolated(mesh: Mesh, values: FloatArray, points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Nodal values at points, and the cell of each point.

    NaN and -1 for points outside the mesh.

    ``values``: shape [nodes, k]. ``points``: shape [n, d].
    """
    element = mesh.element
    corners = mesh.points[mesh.cells]
    near = cKDTree(corners.mean(axis=1)).query(points, k=min(_CELLS, len(mesh.cells)))[1]
    near = near.reshape(len(points), -1)
    found, cell = np.full((len(points), values.shape[1]), np.nan), np.full(len(points), -1)
    for candidates in near.T:
        left = np.flatnonzero(cell < 0)
        if not len(left):
            break
        own = candidates[left]
        xi = np.tile(element.nodes.mean(axis=0), (len(left), 1))
        for _ in range(_NEWTON_STEPS):
            away = points[left] - np.einsum("nk,nkd->nd", element.values(xi), corners[own])
            slopes = np.einsum("nkj,nkd->ndj", element.gradients(xi), corners[own])
            xi = np.clip(xi + np.linalg.solve(slopes, away[..., None])[..., 0], -5.0, 5.0)
        if element.shape == "simplex":
            inside = (xi.min(axis=1) >= -_INSIDE) & (xi.sum(axis=1) <= 1.0 + _INSIDE)
        else:
            inside = np.abs(xi).max(axis=1) <= 1.0 + _INSIDE
        at = left[inside]
        found[at] = np.einsum("nk,nkf->nf", element.values(xi[inside]), values[mesh.cells[own[inside]]])
        cell[at] = own[inside]
    return found, cell


def mesh_error(mesh: Mesh, values: FloatArray) -> FloatArray:
    """Estimated error of nodal values inside each cell, Eq. (P.1), shape [m, k].

    ``values``: shape [nodes, k].
    """
    element, cells = mesh.element, mesh.cells
    corners = mesh.points[cells]
    gradients = element.gradients(element.nodes)
    jacobian = np.einsum("akj,mkd->madj", gradients, corners)
    local = np.einsum("akj,mkf->majf", gradients, values[cells])
    slope = np.einsum("majd,majf->madf", np.linalg.inv(jacobian), local)
    total = np.zeros((len(mesh.points), *slope.shape[2:]))
    np.add.at(total, cells, slope)
    total /= np.maximum(np.bincount(cells.ravel(), minlength=len(total)), 1)[:, None, None]
    jump = np.linalg.norm(total[cells] - slope, axis=2).max(axis=1)
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1).max(axis=(1, 2))
    return np.asarray(0.25 * longest[:, None] * jump)


def predicted(measured: MeasuredField, found: FieldFit, *, gate: float) -> BoolArray:
    """Points that the fitted sheet predicts within its mesh's error, Eq. (P.1), shape [n]."""
    mesh = found.problem.sheet.mesh
    nodal = np.moveaxis(found.cost.state.displacements, 0, 1).reshape(len(mesh.points), -1)
    simulated, cell = interpolated(mesh, nodal, measured.points)
    moved = measured.displacements - found.problem.translation(found.cost.state)
    own = np.moveaxis(moved, 0, 1).reshape(len(measured.points), -1)
    apart = np.abs(own - simulated)
    inside = cell >= 0
    if not inside.any():
        return inside
    scale = MAD * np.median(apart[inside], axis=0)
    return np.asarray(inside & (apart <= gate * scale + mesh_error(mesh, nodal)[cell]).all(axis=1))


def fit_measured(
    measured: MeasuredField, *, gate: float, progress: Progress = SILENT
) -> tuple[MeasuredField, FieldFit]:
    """Fit a measured sheet and readmit suspected points that it predicts, until there are none. Arguments and
    errors are those of `fit_field`."""
    begun = measured.problem.constants.start
    found = fit_field(measured.problem, progress=progress)
    for _ in range(_PASSES):
        if not measured.left_out.any():
            break
        bad = measured.left_out & ~predicted(measured, found, gate=gate)
        if (bad == measured.left_out).all():
            break
        measured = keeping(measured, bad)
        own = measured.problem
        found = fit_field(FieldProblem(own.sheet, own.data, found.constants), progress=progress)
    return measured, with_other_starts(found, begun, progress=progress)


def agrees(value: float, sigma: float, factor: float) -> bool:
    """True if a value agrees with a common factor, within its uncertainty and the explained share."""
    return abs(value - factor) <= 2.0 * float(np.hypot(sigma, 0.5 * EXPLAINED_SHARE * abs(factor)))


def lacking_factor(
    measured: FloatArray, simulated: FloatArray, covariance: FloatArray, sigma: float
) -> tuple[float, float]:
    """Factor of measured values [n] that fits the simulated values with their covariance best, Eq. (P.2), and
    its standard uncertainty [-]."""
    size = float(measured @ measured)
    k = float(simulated @ measured) / size
    own = float(measured @ covariance @ measured) + (k * sigma) ** 2 * size
    return k, float(np.sqrt(own)) / size


def one_change(measured: MeasuredField, found: FieldFit) -> str:
    """A single change of the data that lets the sheet explain field and force, in words, or no words. Common
    factors of the force, the displacements and the mesh, and mirrored axes are tried. Each is confirmed by a
    fit."""
    if found.explained:
        return ""
    problem = measured.problem
    data = problem.data
    near = list(FORCE_FACTORS) if _force_counts(problem) else []
    if near:
        try:
            mute = FieldProblem(problem.sheet, replace(data, sigma_force=_MUTE), problem.constants)
            alone = fit_field(mute.last)
            slopes = alone.cost.state.force_by_constants
            spread = slopes @ alone.covariance @ slopes.T
            lacking = lacking_factor(data.force[-1:], alone.cost.state.force, spread, data.sigma_force)
            near = [factor for factor in near if agrees(*lacking, factor)]
        except (ValueError, np.linalg.LinAlgError):
            pass  # the field does not determine the constants: try every factor
    for factor in near:
        if _explains(problem, replace(data, force=factor * data.force)):
            return _words("force", "field.pad.force", FORCE_FACTORS[factor], factor)
    lack = _field_factor(found)
    for factor, cause in FIELD_FACTORS.items():
        # the constants of a failed fit are not those of the sheet: compare only orders of magnitude
        if factor * lack > 0.0 and abs(np.log10(lack / factor)) < 1.0:
            sigma = abs(factor) * data.sigma_displacement
            moved = replace(data, displacements=factor * data.displacements, sigma_displacement=sigma)
            if _explains(problem, moved):
                return _words("displacements", "field.points.ux and uy", cause, factor)
    return "" if found.adequate else _change_of_place(measured, found)


def _force_counts(problem: FieldProblem) -> bool:
    """True if a positive factor of the force would change more than the moduli, which it multiplies."""
    constants = problem.constants
    moduli = {spec.name for spec in constants.specs if spec.unit == "Pa"}
    reversed_force = float(problem.data.force @ problem.data.pad) < 0.0
    return bool(problem.sheet.held) or not moduli <= set(constants.free) or reversed_force


def _change_of_place(measured: MeasuredField, found: FieldFit) -> str:
    """A reversed component, a wrong unit of the mesh, or a mirrored axis that would explain the field."""
    problem = measured.problem
    data, state = problem.data, found.cost.state
    both = np.einsum("nai,nai->i", found.problem.loaded(data.displacements), state.displacements)
    for axis, name in enumerate("xy"):
        sides = np.where(np.arange(2) == axis, -1.0, 1.0)
        if both[axis] < 0.0 and _explains(problem, replace(data, displacements=sides * data.displacements)):
            return (
                f"one change of the displacements would explain the field and the force: u{name} has the "
                f"wrong sign, as where {name} is counted the other way (field.points.u{name} times -1)"
            )
    mesh = problem.sheet.mesh
    scale = mesh_scale(mesh.points, measured.points)
    if scale is not None:
        sheet = replace(problem.sheet, mesh=replace(mesh, points=scale * mesh.points))
        scaled = replace(measured, problem=FieldProblem(sheet, data, problem.constants))
        if _explains_again(scaled):
            return (
                f"one change of the mesh would explain the field and the force: {scale:g} times its size; "
                "check field.mesh_unit"
            )
    for axis, name in enumerate("xy"):
        sides = np.where(np.arange(2) == axis, -1.0, 1.0)
        ends = mesh.points[:, axis].min() + mesh.points[:, axis].max()
        points = measured.points * sides + np.where(np.arange(2) == axis, ends, 0.0)
        turned = replace(measured, points=points, displacements=sides * measured.displacements)
        if _explains_again(turned, found):
            return (
                f"one change of the mesh would explain the field and the force: its axis {name} is mirrored "
                f"against that of the points; count {name} the same way in both"
            )
    return ""


def _explains_again(measured: MeasuredField, found: FieldFit | None = None) -> bool:
    """True if a sheet with other points or mesh is explained; `found` must simulate them less closely."""
    try:
        problem = keeping(measured, measured.left_out).problem
    except ValueError:
        return False
    if not problem.data.cells.any():
        return False
    if found is not None and problem.misfit(found.cost.state)[-1] >= found.misfit[-1]:
        return False
    return _explains(problem, problem.data)


def _words(what: str, key: str, cause: str, factor: float) -> str:
    """The change in a sentence."""
    return (
        f"one change of the {what} would explain the field and the force: {cause} ({key} times {factor:g}); "
        "check the column's sign and unit"
    )


_MUTE = 1e9
"""Standard deviation that removes the force from the fit [N]."""


def _field_factor(found: FieldFit) -> float:
    """Factor of the displacements that fits the simulated ones best [-]."""
    data, state = found.problem.data, found.cost.state
    loaded = found.problem.loaded(data.displacements)
    both = sum(float(np.sum(a * b)) for a, b in zip(loaded, state.displacements, strict=True))
    own = sum(float(np.sum(a * b)) for a, b in zip(loaded, data.displacements, strict=True))
    return both / own if own > 0.0 else 1.0


def _explains(problem: FieldProblem, data: FieldData) -> bool:
    """True if a fit to the last frame of changed data explains field and force inside the bounds."""
    try:
        trial = fit_field(FieldProblem(problem.sheet, data, problem.constants).last)
    except (ValueError, np.linalg.LinAlgError):
        return False
    return trial.explained and not any(trial.at_bound)
