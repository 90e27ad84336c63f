"""Virtual extensometers: the distance of two places of a surface through the frames."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dic.arrays import BoolArray, FloatArray
from dic.full_field.result import Extension
from dic.surfaces.overlap import overlap_correlation
from dic.surfaces.strains import StrainOutcome
from dic.surfaces.surface_history import SurfaceHistory

FEWEST = 4
"""Fewest valid points about an end."""
THINNEST = 0.3
"""Least spread of these points in any direction [steps, root mean square]."""


@dataclass(frozen=True)
class Extensometer:
    """A virtual extensometer."""

    name: str
    """Its name."""
    ends: tuple[tuple[float, float], tuple[float, float]]
    """Its ends in the reference picture of camera 0 (x, y) [px]."""
    window: int = 3
    """Side of the square of points that give the place of an end [points], odd."""

    def __post_init__(self) -> None:
        if self.window < 3 or self.window % 2 == 0:
            raise ValueError(f"window must be odd and at least 3 points, got {self.window}")
        if self.ends[0] == self.ends[1]:
            raise ValueError(f"the ends of the extensometer {self.name} are one place: {self.ends[0]} px")


def extension(
    surface: SurfaceHistory,
    points: FloatArray,
    extensometer: Extensometer,
    *,
    step: float,
    subset: float,
    reference_sigma: FloatArray | None = None,
) -> Extension:
    """Length of an extensometer in every frame.

    The place of an end is the value there of a plane fitted to the places of the points around it, with the
    same points and weights w at the reference, so that lost points move no end. With the weights g of both
    ends, w of the second less w of the first, and n the unit vector between them the sigma is that of
    ``n · Σ g x`` for errors of the points that correlate as their subsets overlap.

    Parameters
    ----------
    surface
        The surface; elongations refer to its reference positions.
    points
        Places of its points in the reference picture [px], shape [n_points, 2].
    extensometer
        Its ends and window.
    step, subset
        Distance of neighbouring points, and side of the subsets [px].
    reference_sigma
        Standard deviations of the reference positions, independent of the frames' [m], shape [n_points, 3];
        None: they are exact.
    """
    near = [_near(points, end, extensometer.window, step) for end in extensometer.ends]
    rows = np.flatnonzero(near[0] | near[1])
    grid, valid = points[rows], surface.valid[:, rows]
    rho = overlap_correlation(grid, grid, subset)
    rest = np.zeros((rows.size, 3)) if reference_sigma is None else reference_sigma[rows]
    n_frames = surface.n_frames
    length, elongation, sigma = (np.full(n_frames, np.nan) for _ in range(3))
    strain, outcome = np.full(n_frames, np.nan), np.full(n_frames, int(StrainOutcome.TOO_FEW_NEIGHBOURS))
    for k in range(n_frames):
        weights = [
            _weights(grid, valid[k] & own[rows], end, step)
            for own, end in zip(near, extensometer.ends, strict=True)
        ]
        if weights[0] is None or weights[1] is None:
            continue
        g = weights[1] - weights[0]
        here = np.where(valid[k, :, None], surface.position[k, rows], 0.0)
        between, before = g @ here, g @ surface.X[rows]
        length[k], initial = np.linalg.norm(between), np.linalg.norm(before)
        elongation[k] = length[k] - initial
        strain[k] = elongation[k] / initial
        noise = np.where(valid[k, :, None], surface.sigma[k, rows], 0.0)
        n, n0 = between / length[k], before / initial
        sigma[k] = np.sqrt(
            sum(
                (n[c] ** 2) * _variance(g * noise[:, c], rho) + (n0[c] ** 2) * _variance(g * rest[:, c], rho)
                for c in range(3)
            )
        )
        outcome[k] = int(StrainOutcome.VALID)
    return Extension(
        extensometer.name,
        np.array(extensometer.ends),
        length,
        elongation,
        sigma,
        strain,
        outcome,
    )


def extensions(
    surface: SurfaceHistory, points: FloatArray, wanted: Sequence[Extensometer], **given: object
) -> tuple[Extension, ...]:
    """`extension` of several extensometers.

    Raises
    ------
    ValueError
        If an end lies beside all points, so that no frame could give a length.
    """
    for one in wanted:
        for end in one.ends:
            if _near(points, end, one.window, float(given["step"])).sum() < FEWEST:  # type: ignore[arg-type]
                raise ValueError(
                    f"the end ({end[0]:g}, {end[1]:g}) px of the extensometer {one.name} has fewer than "
                    f"{FEWEST} points around it: place it on the region, or enlarge its window"
                )
    return tuple(extension(surface, points, one, **given) for one in wanted)  # type: ignore[arg-type]


def _near(points: FloatArray, end: tuple[float, float], window: int, step: float) -> BoolArray:
    """Points in the window about an end, shape [n_points]."""
    return np.asarray((np.abs(points - np.array(end)) <= 0.5 * window * step + 1e-9).all(axis=1))


def _weights(grid: FloatArray, used: BoolArray, end: tuple[float, float], step: float) -> FloatArray | None:
    """Weights that give the value at `end` of the plane through the used points, shape [n]; None if these are
    too few or nearly on a line."""
    if used.sum() < FEWEST:
        return None
    q = (grid[used] - np.array(end)) / step
    if np.linalg.eigvalsh(np.cov(q.T, bias=True))[0] < THINNEST**2:
        return None
    T = np.column_stack([np.ones(len(q)), q])
    weights = np.zeros(len(grid))
    weights[used] = np.linalg.solve(T.T @ T, T.T)[0]
    return weights


def _variance(g: FloatArray, rho: FloatArray) -> float:
    return float(g @ rho @ g)
