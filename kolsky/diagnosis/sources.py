"""What a right model leaves of the data, by source: changes of the predicted data vector."""

from collections.abc import Mapping

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.fit_results import MESH
from kolsky.uncertainty.input_directions import InputDirections
from kolsky.uncertainty.numerical import BETWEEN, ELEMENT_ORDER, MeshChange
from kolsky.uncertainty.route_budgets import Sources

DECLARED = "declared inputs"
"""Everything that [uncertainty] of the shot file declares."""
ORDER = 2.0
"""Order of the mesh error in the data vector: what rings comes in more slowly than the parameters do."""


def residual_sources(
    sources: Sources, directions: InputDirections | None, uncertainty: Mapping[str, float]
) -> dict[str, FloatArray]:
    """Changes of the predicted data vector by one standard uncertainty of each source.

    Parameters
    ----------
    sources
        Noise and scales of the inputs, mesh and element.
    directions
        What each input does to the data vector; None if that is not known.
    uncertainty
        Declared standard uncertainties by their keys.

    Returns
    -------
    dict
        Source -> changes, shape [n, k] or [k].
    """
    inputs = sources.inputs
    found = {name: change for name, change in inputs.replicates.items() if len(change)}
    found |= {**inputs.scales, MESH: mesh_changes(sources.mesh)}
    if directions is not None:
        declared = declared_changes(directions, uncertainty)
        if len(declared):
            found[DECLARED] = declared
    return found


def mesh_changes(mesh: MeshChange) -> FloatArray:
    """Remaining errors of the refined mesh's data vector, those of mesh and element in quadrature, [n, k]."""
    rows = [mesh.coarser / (mesh.ratio**ORDER - 1.0)]
    if mesh.element is not None:
        rows.append(mesh.element / (BETWEEN * mesh.ratio**ELEMENT_ORDER))
    return in_quadrature(rows)


def declared_changes(directions: InputDirections, uncertainty: Mapping[str, float]) -> FloatArray:
    """Changes by the declared standard uncertainties in quadrature, shape [n, k]."""
    keys = [key for key, sigma in uncertainty.items() if sigma > 0.0 and key in directions.keys]
    return in_quadrature([uncertainty[key] * directions[key].slope for key in keys])


def in_quadrature(rows: list[FloatArray]) -> FloatArray:
    """Changes as rows whose mean square is the sum of their squares, shape [n, k]."""
    return np.asarray(np.sqrt(len(rows)) * np.array(rows))
