"""Stored histories of one device or precision for comparison with another one."""

from pathlib import Path

import numpy as np

from benchmarks.measure import Measurement
from benchmarks.problem import FloatArray

LARGEST_KEPT = 100
"""Batches with more runs are not stored."""

Histories = dict[str, FloatArray]


def load(path: Path | None) -> Histories:
    """Read a file of `save`; empty without a path."""
    return dict(np.load(path)) if path else {}


def save(path: Path, measurements: list[Measurement]) -> None:
    """Write the forces and outlines of the smaller batches."""
    kept = {}
    for m in measurements:
        if m.runs <= LARGEST_KEPT:
            key = f"{m.contact}-{m.precision}-{m.runs}"
            kept[f"{key}-force"] = m.response.force_transmission
            kept[f"{key}-r"] = m.response.surface_r
    np.savez_compressed(path, **kept)  # type: ignore[arg-type]


def differences(m: Measurement, kept: Histories) -> dict[str, float]:
    """Largest differences between a batch and the same stored batch, in fp64 and in its precision."""
    found = {}
    for other in dict.fromkeys(("fp64", m.precision)):
        name = f"{m.contact}-{other}-{m.runs}"
        if f"{name}-force" in kept:
            force = np.abs(m.response.force_transmission - kept[f"{name}-force"]).max()
            radius = np.abs(m.response.surface_r - kept[f"{name}-r"]).max()
            found[f"force_difference_to_{other}_N"] = float(force)
            found[f"radius_difference_to_{other}_um"] = float(radius * 1e6)
    return found
