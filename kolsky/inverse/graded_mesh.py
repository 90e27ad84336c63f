"""Meshes whose elements are small where the faces end, beside those of the search.

The edge of a face that holds is a singularity of the stress, and from there come most of the elements'
errors in how a specimen rings: small elements at the edges are worth more than smaller ones everywhere
(`python -m benchmarks.truth_meshes`). They cost shorter steps, so the search goes without them, and a few
runs on such meshes tell the search's error.
"""

from __future__ import annotations

from dataclasses import replace

from kolsky.inverse.forward import Numerics

GRADING = 5.0
"""Largest over smallest element."""
SHARE = 0.625
"""Elements across the radius of the coarser graded mesh over those of the finer one [-]."""


def graded(numerics: Numerics, refined: tuple[int, int]) -> Numerics:
    """As many elements as the refined mesh has, graded."""
    return replace(numerics, mesh=refined, grading=GRADING)


def coarser_graded(numerics: Numerics, refined: tuple[int, int]) -> Numerics:
    """A graded mesh of a quarter of that one's cost, whose ringing is as good as the refined mesh's."""
    across, along = refined
    return graded(numerics, (round(SHARE * across), round(SHARE * along)))
