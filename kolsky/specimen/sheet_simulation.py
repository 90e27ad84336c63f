"""A sheet before its test: simulated measurements, and what its field and its force would tell."""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.specimen.field_problem import Cost, FieldProblem
from kolsky.specimen.field_reading import MeasuredField
from kolsky.specimen.field_sensitivity import SMALLEST_EIGENVALUE
from kolsky.specimen.planning import Expected, plan
from kolsky.specimen.projection import project

FIELD, FORCE = "field", "force"
"""Names of the two parts of a sheet's test."""


@dataclass(frozen=True)
class SimulatedSheet:
    """Simulated measurements of a sheet."""

    frames: tuple[int, ...]
    """Numbers of the frames."""
    points: FloatArray
    """Places of the points [m], shape [n, 2]."""
    displacements: FloatArray
    """Of the points, with their noise if there is any [m], shape [frames, n, 2]."""
    pad: FloatArray
    """Displacement of the moving pad [m], shape [frames]."""
    force: FloatArray
    """Force on it, likewise [N], shape [frames]."""

    @property
    def point_columns(self) -> dict[str, FloatArray]:
        """Columns of the CSV file that `[field.points]` can name."""
        n = len(self.points)
        places = np.tile(self.points, (len(self.frames), 1))
        moved = self.displacements.reshape(-1, 2)
        return {
            "frame": np.repeat(self.frames, n),
            "x (mm)": 1e3 * places[:, 0],
            "y (mm)": 1e3 * places[:, 1],
            "ux (mm)": 1e3 * moved[:, 0],
            "uy (mm)": 1e3 * moved[:, 1],
        }

    @property
    def pad_columns(self) -> dict[str, FloatArray]:
        """Columns of the CSV file that `[field.pad]` can name."""
        return {
            "frame": np.array(self.frames),
            "pad (mm)": 1e3 * self.pad,
            "force (mN)": 1e3 * self.force,
        }


def simulate_sheet(measured: MeasuredField, *, seed: int | None = None) -> SimulatedSheet:
    """Measurements of a sheet with the declared constants, at the points and pad displacements of its files.

    Parameters
    ----------
    measured
        The sheet; what was measured of it is not used but for the places and the noise.
    seed
        Of the noise of displacements and forces; None: no noise.

    Raises
    ------
    ValueError
        If the simulation fails, with its reason.
    """
    problem = measured.problem
    cost = _simulated(problem)
    nodal = np.moveaxis(cost.state.displacements, 0, 1)
    at_points = project(problem.sheet.mesh.points, nodal.reshape(len(nodal), -1), measured.points).values
    u = np.moveaxis(at_points.reshape(len(measured.points), -1, 2), 0, 1)
    force = cost.state.force
    if seed is not None:
        rng = np.random.default_rng(seed)
        u = u + problem.data.sigma_displacement * rng.standard_normal(u.shape)
        force = force + problem.data.sigma_force * rng.standard_normal(force.shape)
    return SimulatedSheet(measured.frames, measured.points, u, problem.data.pad, force)


def plan_sheet(problem: FieldProblem, *, wanted: tuple[str, ...] = ()) -> list[Expected]:
    """Expected deviations of the constants from the field and the force together, and from each alone.

    The information of the field is int du/dm_I . du/dm_J / (a sigma_u^2), Eq. (K.30) over the noise of one
    point for the area a, that of the force df/dm_I df/dm_J / sigma_f^2.

    Raises
    ------
    ValueError
        If the simulation fails, with its reason.
    """
    cost, data, constants = _simulated(problem), problem.data, problem.constants
    variance = data.area * data.sigma_displacement**2
    sizes = np.maximum(np.abs(constants.start), 1e-3 * constants.scales)
    information = cost.curvature_displacement / variance * np.outer(sizes, sizes)
    values, vectors = np.linalg.eigh(information)
    seen = values > SMALLEST_EIGENVALUE * values[-1]
    rows = np.zeros_like(vectors)
    rows[seen] = (vectors * np.sqrt(np.maximum(values, 0.0))).T[seen] / sizes
    whitened = {FIELD: rows, FORCE: cost.state.force_by_constants / data.sigma_force}
    peak = float(np.abs(cost.state.force).max())
    choices = ((FIELD, FORCE), (FIELD,), (FORCE,))
    return plan(choices, whitened, {FIELD: peak, FORCE: peak}, constants, wanted=wanted)


def _simulated(problem: FieldProblem) -> Cost:
    cost = problem.cost(problem.constants.start)
    if isinstance(cost, str):
        raise ValueError(cost)
    return cost
