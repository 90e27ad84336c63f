"""Results of a measurement: of a specimen by two cameras, or of a full field."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray, IntArray
from dic.bodies.axial_displacement import AxialDisplacement
from dic.bodies.body_motion import BodyMotion
from dic.camera import StereoRig
from dic.outcome import FrameOutcome, PointOutcome, Remark
from dic.surfaces.cylinder import SpecimenFrame
from dic.surfaces.surface_history import SMALLEST_SERIES, CentrePoints, NoiseFloor, SurfaceHistory
from dic.views import ResultViews


class _Surfaced(ResultViews):
    """Counts of points, for results with a surface."""

    surface: SurfaceHistory

    @property
    def n_valid(self) -> IntArray:
        """Valid points of each frame, shape [n_frames]."""
        return np.asarray(self.surface.valid.sum(axis=1), dtype=np.int64)

    def outcomes(self) -> dict[PointOutcome, int]:
        """Number of points of each outcome, over all frames; outcomes without points are left out."""
        numbers, counts = np.unique(self.surface.outcome, return_counts=True)
        return {PointOutcome(int(n)): int(c) for n, c in zip(numbers, counts, strict=True)}


@dataclass(frozen=True)
class Body(_Surfaced):
    """Points of one body: their motion, their pixels in both cameras and the quality of the matches."""

    surface: SurfaceHistory
    """Motion in the test frame."""
    pixels: tuple[FloatArray, FloatArray]
    """Positions of the points in the two cameras' pictures [px], each [n_frames, n_points, 2]; NaN where
    lost."""
    match_sigma: tuple[FloatArray, FloatArray]
    """Standard deviation of these positions, root mean square of x and y [px], each [n_frames, n_points]."""
    zncc: tuple[FloatArray, FloatArray]
    """Zero-normalised cross-correlation with the reference used, each of shape [n_frames, n_points]."""
    epipolar: FloatArray
    """Signed distance of camera 1's point from the epipolar line of camera 0's point [px], [n_frames,
    n_points]."""
    points: FloatArray
    """Positions (x, y) in the material picture of camera 0 [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""

    @property
    def epipolar_rms(self) -> float:
        """Root mean square of the epipolar distances of valid points [px]; NaN if there are none."""
        valid = self.epipolar[self.surface.valid]
        return float(np.sqrt(np.mean(valid**2))) if valid.size else float("nan")


@dataclass(frozen=True)
class Placement:
    """Test frame in the rig's frame, and the cylinder that defines it."""

    frame: SpecimenFrame
    radius: float
    """Radius of the best-fit cylinder of the specimen at rest [m]."""
    radius_sigma: float
    """Its standard deviation from the noise of the matches [m]."""
    rms: float
    """Root mean square distance of the points from it [m]."""
    chi2_per_dof: float
    """Sum of the squared distances over their variances, per degree of freedom [-]."""
    n_points: int
    """Number of points in the fit."""


@dataclass(frozen=True)
class SurfaceStrain:
    """Green-Lagrange strains in the tangent plane of the undeformed surface; NaN where the outcome is not
    VALID."""

    value: FloatArray
    """Components around the axis, along it, and shear [-], shape [n_frames, n_points, 3]."""
    sigma: FloatArray
    """Their standard deviations [-], same shape."""
    outcome: IntArray
    """`dic.surfaces.strains.StrainOutcome`, shape [n_frames, n_points]."""
    gauge: float
    """Side of the virtual strain gauge in the material picture [px]."""


@dataclass(frozen=True)
class StereoResult(ResultViews):
    """Result of a stereo measurement from two series of pictures."""

    t: FloatArray
    """Frame times [s], shape [n_frames]."""
    frames: tuple[IntArray, IntArray]
    """`FrameOutcome` of each camera's pictures, each of shape [n_frames]."""
    static: NDArray[np.bool_]
    """Static frames: those in which the specimen is at rest, shape [n_frames]."""
    specimen: Body
    """Points of the specimen."""
    flyer: Body | None
    """Points of the flyer; None if no region was given."""
    axial_displacement: AxialDisplacement | None
    """The flyer's axial displacement; None if it was not found."""
    centre: CentrePoints
    """The outline on the centre line."""
    placement: Placement
    """The test's coordinates."""
    noise: NoiseFloor
    """Noise floors of the specimen's displacements."""
    strain: SurfaceStrain
    """Strains of the specimen's surface."""
    remarks: tuple[Remark, ...]
    """Remarks on the test and its declarations; empty if there are none."""
    rig: StereoRig
    """The cameras, for the cropped pictures."""
    facts: Mapping[str, Any]
    """Settings and facts of the pictures, in JSON types."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Wall time of each stage [s]."""
    motion: BodyMotion | None = None
    """The flyer's rigid motion, in the frames with enough points to determine it."""

    @property
    def strain_noise(self) -> FloatArray:
        """Standard deviation of strains over the static frames: around, along, shear [-], shape [3]. It is
        the root mean square over the points with a strain in all static frames; NaN without such points."""
        values = self.strain.value[self.static & (self.outcome == FrameOutcome.VALID)]
        values = values[:, np.isfinite(values).all(axis=(0, 2))]
        if len(values) < SMALLEST_SERIES or values.shape[1] == 0:
            return np.full(3, np.nan)
        return np.asarray(np.sqrt(values.var(axis=0, ddof=1).mean(axis=0)))

    @property
    def outcome(self) -> IntArray:
        """`FrameOutcome` of each pair: camera 0's, then camera 1's, LOST if no point was found,
        [n_frames]."""
        first, second = self.frames
        pair = np.where(first != FrameOutcome.VALID, first, second)
        empty = (pair == FrameOutcome.VALID) & (self.specimen.n_valid == 0)
        return np.asarray(np.where(empty, int(FrameOutcome.LOST), pair), dtype=np.int64)


KINDS = ("plane", "surface", "cylinder")
"""Kinds of measurement."""


@dataclass(frozen=True)
class Extension:
    """Length of a virtual extensometer in every frame; NaN where the outcome is not VALID."""

    name: str
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
    """Cylinder fitted to the points of each frame; NaN where no cylinder could be fitted."""

    radius: FloatArray
    """Radius [m], shape [n_frames]."""
    sigma: FloatArray
    """Its standard deviation from the noise of the matches [m], shape [n_frames]."""
    rms: FloatArray
    """Root mean square distance of the points from the cylinder [m], shape [n_frames]."""
    n_points: IntArray
    """Number of points in the fit, shape [n_frames]."""
    correction: float
    """Median size of the correction for the curvature within the subsets, in camera 1 [px]."""
    uncorrected: float
    """Radius in the reference frame without that correction [m]."""


@dataclass(frozen=True)
class FullField(_Surfaced):
    """Displacements and strains of a surface.

    On a plane, x points to the right and y down, as in the picture. On a surface, x points to the right and y
    up in the best-fit plane of the reference points, and Z toward the cameras. On a cylinder, y is along the
    axis, and Z points from the axis toward the cameras.
    """

    kind: str
    """One of `KINDS`."""
    unit: str
    """Unit of lengths: "m", or "px" for a plane whose scale was not given."""
    timed: bool
    """True if `surface.t` holds clock times [s]; False if it holds frame numbers."""
    frame_outcome: IntArray
    """`FrameOutcome` of each frame, the worse one of two cameras, shape [n_frames]."""
    surface: SurfaceHistory
    """Reference positions, displacements and sigmas in `unit`, and an outcome for every point and frame."""
    strain: SurfaceStrain
    """Green-Lagrange strains xx, yy, xy with their sigmas."""
    points: FloatArray
    """Positions (x, y) in the reference picture of camera 0 [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""
    pixels: FloatArray
    """Positions in the pictures [px], NaN where lost, shape [n_cameras, n_frames, n_points, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation of the matches [-], shape [n_cameras, n_frames, n_points]."""
    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's [px], shape [n_frames, n_points];
    NaN for one camera."""
    noise: FloatArray
    """Standard deviation of the grey values of each camera [grey], shape [n_cameras]."""
    extensions: tuple[Extension, ...] = ()
    cylinder: FittedCylinder | None = None
    """Cylinder of each frame; None for kinds other than "cylinder"."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on cameras and pictures; empty if there are none."""
    facts: Mapping[str, Any] = field(default_factory=dict)
    """Settings and facts, in JSON types."""

    @property
    def mean_strain(self) -> FloatArray:
        """Mean strain of the valid points [-], shape [n_frames, 3]; NaN in frames without valid points."""
        valid = np.asarray(np.isfinite(self.strain.value).all(axis=2))
        count = valid.sum(axis=1)[:, None]
        total = np.where(valid[..., None], self.strain.value, 0.0).sum(axis=1)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def bad_frames(self) -> dict[int, FrameOutcome]:
        """Frames without points: frame number and outcome."""
        bad = np.flatnonzero(self.frame_outcome != FrameOutcome.VALID)
        return {int(k): FrameOutcome(int(self.frame_outcome[k])) for k in bad}
