"""Distance between two outlines: of the surface nodes of a mesh to a reference's polyline."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def distances(points: FloatArray, line: FloatArray) -> FloatArray:
    """Distance of each point to the closest place of a polyline [m], shape [n_points].

    Measured along the normal, so it is as meaningful where the outline runs along a platen as where it
    stands upright, which a difference of radii at equal height is not.

    Parameters
    ----------
    points : array, shape [n_points, 2]
    line : array, shape [n_vertices, 2]
        Vertices in order.
    """
    start, along = line[:-1], np.diff(line, axis=0)
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=-1).min(axis=1))


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
