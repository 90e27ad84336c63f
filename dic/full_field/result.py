"""Result of a full-field measurement."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dic.arrays import FloatArray, IntArray
from dic.outcome import FrameOutcome, PointOutcome, Remark
from dic.result import SurfaceStrain
from dic.surfaces.surface_history import SurfaceHistory

KINDS = ("plane", "surface", "cylinder")
"""Kinds of measurement."""


@dataclass(frozen=True)
class Extension:
    """Length of a virtual extensometer through the frames; NaN where the outcome is not VALID."""

    name: str
    """Its name."""
    ends: FloatArray
    """Its two ends in the reference picture of camera 0 (x, y) [px], shape [2, 2]."""
    length: FloatArray
    """Distance of its ends [m or px], shape [n_frames]."""
    elongation: FloatArray
    """Change of that distance since the reference [m or px], shape [n_frames]."""
    sigma: FloatArray
    """Standard deviation of the elongation [m or px], shape [n_frames]."""
    strain: FloatArray
    """Elongation over the length at the reference [-], shape [n_frames]."""
    outcome: IntArray
    """`dic.surfaces.strains.StrainOutcome`, shape [n_frames]."""


@dataclass(frozen=True)
class FittedCylinder:
    """Cylinder fitted to the points of each frame; NaN where none fits."""

    radius: FloatArray
    """Radius [m], shape [n_frames]."""
    sigma: FloatArray
    """Its standard deviation from the noise of the matches [m], shape [n_frames]."""
    rms: FloatArray
    """Root mean square distance of the points from the cylinder [m], shape [n_frames]."""
    n_points: IntArray
    """Points that the fit rests on, shape [n_frames]."""
    correction: float
    """Median size of the correction for the curvature inside the subsets, in camera 1 [px]."""
    uncorrected: float
    """Radius in the reference frame without that correction [m]."""


@dataclass(frozen=True)
class FullField:
    """Displacements and strains of a surface.

    Coordinates: of a plane x to the right and y down, as in its picture; of a surface x to the right and y up
    in the plane that fits the points at the reference best, Z toward the cameras; of a cylinder y along its
    axis, Z from the axis toward the cameras.
    """

    kind: str
    """One of `KINDS`."""
    unit: str
    """Unit of lengths: "m", or "px" for a plane whose scale was not given."""
    timed: bool
    """True if the times are those of a clock; False if they count the frames."""
    frame_outcome: IntArray
    """`FrameOutcome` of each frame, the worse of two cameras, shape [n_frames]."""
    surface: SurfaceHistory
    """Reference places, displacements and sigmas in `unit`, and an outcome for every point and frame."""
    strain: SurfaceStrain
    """Green-Lagrange strains xx, yy, xy with their sigmas."""
    points: FloatArray
    """Places in the reference picture of camera 0 (x, y) [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""
    pixels: FloatArray
    """Places in the pictures [px], NaN where lost, shape [n_cameras, n_frames, n_points, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation of the matches [-], shape [n_cameras, n_frames, n_points]."""
    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's [px], shape [n_frames, n_points];
    NaN for one camera."""
    noise: FloatArray
    """Standard deviation of the grey values of each camera [grey], shape [n_cameras]."""
    extensions: tuple[Extension, ...] = ()
    """Virtual extensometers."""
    cylinder: FittedCylinder | None = None
    """Cylinder of each frame, of the kind "cylinder"."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on cameras and pictures."""
    facts: Mapping[str, Any] = field(default_factory=dict)
    """Settings and facts, as JSON can hold them."""

    @property
    def n_valid(self) -> IntArray:
        """Valid points of each frame, shape [n_frames]."""
        return np.asarray(self.surface.valid.sum(axis=1), dtype=np.int64)

    @property
    def mean_strain(self) -> FloatArray:
        """Mean strain of the valid points, NaN in frames without any [-], shape [n_frames, 3]."""
        valid = np.asarray(np.isfinite(self.strain.value).all(axis=2))
        count = valid.sum(axis=1)[:, None]
        total = np.where(valid[..., None], self.strain.value, 0.0).sum(axis=1)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def outcomes(self) -> dict[PointOutcome, int]:
        """Number of points of each outcome, over all frames; outcomes without points are left out."""
        numbers, counts = np.unique(self.surface.outcome, return_counts=True)
        return {PointOutcome(int(n)): int(c) for n, c in zip(numbers, counts, strict=True)}

    def bad_frames(self) -> dict[int, FrameOutcome]:
        """Frames that gave no points, by number."""
        bad = np.flatnonzero(self.frame_outcome != FrameOutcome.VALID)
        return {int(k): FrameOutcome(int(self.frame_outcome[k])) for k in bad}
