"""What a right model leaves of the data, by source: changes of the predicted data vector."""

from kolsky.base.arrays import FloatArray
from kolsky.inverse.fit_results import MESH
from kolsky.uncertainty.input_directions import in_quadrature
from kolsky.uncertainty.numerical import ELEMENT_ORDER, MeshChange
from kolsky.uncertainty.route_budgets import Sources

DECLARED = "declared inputs"
"""Everything that [uncertainty] of the shot file declares."""
ORDER = 2.0
"""Order of the mesh error in the data vector: what rings comes in more slowly than the parameters do."""
BETWEEN = 3.0**0.5
"""Distance of the two elements' data over the standard uncertainty of one's: the truth may lie anywhere
between them, the root mean square of its distance from one end is a root of three less."""


def residual_sources(sources: Sources) -> dict[str, FloatArray]:
    """Changes of the predicted data vector by one standard uncertainty of each source.

    Parameters
    ----------
    sources
        Noise and scales of the inputs, what is declared uncertain, mesh and element.

    Returns
    -------
    dict
        Source -> changes, shape [n, k] or [k].
    """
    inputs = sources.inputs
    found = {name: change for name, change in inputs.replicates.items() if len(change)}
    found |= {**inputs.scales, MESH: mesh_changes(sources.mesh)}
    if sources.declared is not None and len(sources.declared):
        found[DECLARED] = sources.declared
    return found


def mesh_changes(mesh: MeshChange) -> FloatArray:
    """Remaining errors of the refined mesh's data vector, those of mesh and element in quadrature, [n, k]."""
    coarser = mesh.coarser / (mesh.ratio**ORDER - 1.0)
    rows = [coarser if mesh.graded is None else mesh.graded.error]
    if mesh.element is not None:
        rows.append(mesh.element / (BETWEEN * mesh.ratio**ELEMENT_ORDER))
    return in_quadrature(rows)
