"""Figures, one file each; a new one is its file and one line of `REGISTRY`."""

from kolsky.report.figures import (
    contour,
    energy,
    force,
    force_residual,
    meshes,
    misfit,
    profiles,
    shape_residual,
)
from kolsky.report.figures.base import FigureKind

__all__ = ["REGISTRY", "FigureKind"]

REGISTRY: dict[str, FigureKind] = {
    module.KIND.name: module.KIND
    for module in (force, shape_residual, profiles, force_residual, misfit, contour, energy, meshes)
}
"""Every figure by name, in the order of the report."""
