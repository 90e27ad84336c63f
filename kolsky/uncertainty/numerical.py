"""The numerics' part of an interval: what is left of the mesh's and the element's error, and roughness."""

import numpy as np

from kolsky.base.arrays import FloatArray

ORDER = 2.0
"""Order of the mesh error used for the refined mesh's remaining error; fitted in the verification manual."""
SAFETY_FACTOR = 1.25
"""Factor on the extrapolated mesh error (Roache's grid convergence index with a fitted order)."""
ONE_SIDED = 1.15
"""The index over its standard uncertainty: the mesh errs to one side, by about as much as is extrapolated,
and not evenly about zero, where it would be 2 (ASME V&V 20-2009)."""
EITHER_SIDE = 3.0**0.5
"""The other element's move of the optimum over its standard uncertainty: the truth may lie anywhere between
the two and as far on the other side (a rectangular distribution, GUM 4.3.7)."""


def mesh_uncertainty(shift: FloatArray, *, coarse: int, fine: int) -> FloatArray:
    """Standard uncertainty from the refined mesh's remaining error, by Richardson's extrapolation.

    Parameters
    ----------
    shift
        Optimum on the refined mesh minus that on the coarser one, shape [d].
    coarse, fine
        Elements across the radius of both meshes.

    Returns
    -------
    ndarray
        In the parameters' units, shape [d].
    """
    return np.asarray(SAFETY_FACTOR / ONE_SIDED * np.abs(shift) / ((fine / coarse) ** ORDER - 1.0))


def element_uncertainty(shift: FloatArray) -> FloatArray:
    """Standard uncertainty from the element, of the optimum with the other one minus the answer, [d]."""
    return np.asarray(np.abs(shift) / EITHER_SIDE)


def numerical_uncertainty(
    mesh_shift: FloatArray,
    *,
    coarse: int,
    fine: int,
    element_shift: FloatArray | None = None,
    roughness: FloatArray | None = None,
) -> dict[str, FloatArray]:
    """Standard uncertainties from the numerics by source, shape [d] each.

    Parameters
    ----------
    mesh_shift, coarse, fine
        As of `mesh_uncertainty`.
    element_shift
        As of `element_uncertainty`; None if it is not known.
    roughness
        Standard deviation of the optimum from the response's roughness, shape [d]; None if it is smooth.

    Returns
    -------
    dict
        "mesh" is the larger of the mesh's and the element's part, parameter by parameter: both are estimates
        of one error, that of the discretisation. "roughness" only where it is given.
    """
    found = {"mesh": mesh_uncertainty(mesh_shift, coarse=coarse, fine=fine)}
    if element_shift is not None:
        found["mesh"] = np.fmax(found["mesh"], element_uncertainty(element_shift))
    if roughness is not None:
        found["roughness"] = roughness
    return found
