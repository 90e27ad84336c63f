"""Two pictures of one instant and the points to be matched between them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.camera import StereoRig
from dic.correlation import warp as warps
from dic.correlation.search import correlate
from dic.correlation.settings import Correlation, Match
from dic.correlation.stack import PictureStack
from dic.outcome import PointOutcome
from dic.stereo.epipolar import epipolar_distance, epipolar_sigma
from dic.stereo.facet import distance_along, facet_geometry
from dic.stereo.settings import StereoGates, StereoSearch
from dic.stereo.triangulation import midpoint

MARGIN = 0.5
"""Distances found are widened on both sides by this share of their span in the search of second peaks ..."""
ROOM = 2.0
"""... and by at least so many subsets along the curve."""


@dataclass(frozen=True)
class Pair:
    """Inputs of one stereo match; every point has a place in camera 0."""

    rig: StereoRig
    """The cameras."""
    pictures: tuple[NDArray[np.float32], NDArray[np.float32]]
    """Their grey values, each of shape [rows, columns]."""
    stacks: tuple[PictureStack, PictureStack]
    """The same, prepared."""
    points: FloatArray
    """Places in the material picture [px], shape [n, 2]."""
    reference: FloatArray
    """Warps to camera 0's picture, shape [n, 12]."""
    mask: BoolArray | None
    """Pixels of the material picture that belong to the specimen."""
    settings: Correlation
    """Of the match."""
    search: StereoSearch
    """Search for initial guesses."""
    gates: StereoGates
    """Gates of a match."""

    @property
    def places(self) -> FloatArray:
        """Places of the points in camera 0 [px], shape [n, 2]."""
        return warps.apply(self.points, self.reference)

    def correlate(self, rows: IntArray, guess: FloatArray, **changed: object) -> Match:
        """Match the points of these rows from these guesses, with some of the settings changed."""
        return correlate(
            *self.stacks,
            self.points[rows],
            guess,
            replace(self.settings, **changed),  # type: ignore[arg-type]
            reference_warp=self.reference[rows],
            mask=self.mask,
        )

    def correlate_back(self, rows: IntArray, warp: FloatArray, guess: FloatArray, tolerance: float) -> Match:
        """Match camera 1's subsets at `warp` in camera 0; found are total warps again."""
        return correlate(
            *self.stacks[::-1],
            self.points[rows],
            guess,
            replace(self.settings, tolerance=max(tolerance, self.settings.tolerance)),
            reference_warp=warp,
            mask=self.mask,
        )

    def epipolar(self, rows: IntArray, match: Match) -> tuple[FloatArray, FloatArray]:
        """Epipolar distance and its sigma [px], shape [rows]; inf where the match is none."""
        distance, sigma = np.full(len(rows), np.inf), np.zeros(len(rows))
        some = match.outcome == PointOutcome.VALID
        pixels = self.places[rows][some], warps.apply(self.points[rows], match.warp)[some]
        distance[some] = epipolar_distance(self.rig, *pixels)
        sigma[some] = epipolar_sigma(self.rig, *pixels, np.zeros((2, 2)), match.covariance[some])
        return distance, sigma

    def distances(self, rows: IntArray, warp: FloatArray) -> FloatArray:
        """Of points matched by `warp`, along camera 0's rays [m], shape [rows]."""
        places0, places1 = self.places[rows], warps.apply(self.points[rows], warp)
        return distance_along(self.rig, places0, midpoint(self.rig, places0, places1))

    def around(self, rows: IntArray, warp: FloatArray) -> tuple[float, float]:
        """Nearest and farthest distance of matched points, with room for second peaks on either side [m]."""
        distance = self.distances(rows, warp)
        near, far = float(distance.min()), float(distance.max())
        seen = facet_geometry(self.rig, self.places[rows], distance)
        pace = np.median(np.linalg.norm(seen.P @ seen.d[..., None], axis=1))  # along the curve [px/m]
        margin = max(MARGIN * (far - near), ROOM * self.settings.subset / float(pace))
        return max(near - margin, near / 2.0), far + margin
