"""Points of camera 0 found in camera 1, on surfaces that curve, seen from far apart."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.camera import StereoRig
from dic.correlation import warp as warps
from dic.correlation.match import Match
from dic.correlation.search import correlate
from dic.correlation.settings import Correlation
from dic.correlation.stack import Noise, PictureStack
from dic.correlation.warp import Shape
from dic.outcome import PointOutcome
from dic.stereo.candidates import SAMPLES, subsets
from dic.stereo.candidates import search as search_curves
from dic.stereo.epipolar import epipolar_distance, epipolar_sigma
from dic.stereo.facet import distance_along, fit_facet
from dic.stereo.gates import Evidence, Gate, judge, neighbours_disagree, slope
from dic.stereo.propagate import neighbourhood, propagate
from dic.stereo.settings import StereoGates, StereoSearch
from dic.stereo.sight import directions
from dic.stereo.triangulate import midpoint

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

SEARCHED = 31
"""Smallest side of the subset that a whole epipolar curve is searched with by default [px]."""
MARGIN = 0.5
"""Distances found are widened on both sides by this share of their span when rivals are looked for."""


@dataclass(frozen=True)
class StereoMatch:
    """Where camera 1 sees the points of camera 0, one row a point; rows not VALID hold the last try."""

    points: FloatArray
    """Places in the material picture (x, y) [px], shape [n, 2]."""
    warp: FloatArray
    """Total warps from the material picture to camera 1's, shape [n, 12]."""
    covariance: FloatArray
    """Of the position in camera 1 from the noise of both pictures [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""
    failed: IntArray
    """Gates not passed, a sum of `Gate` members, shape [n]."""
    evidence: Evidence
    """The number behind each gate."""

    @property
    def valid(self) -> BoolArray:
        """Points that passed every gate, shape [n]."""
        return np.asarray(self.outcome == PointOutcome.VALID)

    def count(self) -> dict[Gate, int]:
        """How many points failed each gate; a point may fail several."""
        return {gate: int(np.sum(self.failed & int(gate) != 0)) for gate in Gate}


def match_stereo(
    picture0: ArrayLike,
    picture1: ArrayLike,
    points: ArrayLike,
    rig: StereoRig,
    settings: Correlation,
    *,
    noise: float | Noise,
    reference_warp: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    search: StereoSearch | None = None,
    gates: StereoGates | None = None,
    device: str = "cpu",
) -> StereoMatch:
    """Find points of camera 0's picture in camera 1's, and judge every match by gates of their own.

    A few seeds are looked for along their whole epipolar curves, their subsets deformed as facets of several
    slopes would be seen; the other points follow from neighbours, the most reliable first, with affine
    shape functions; the shape function of `settings` has the last word. See {doc}`/theory/stereo_matching`.

    Parameters
    ----------
    picture0, picture1
        Grey values of one instant, shapes [rows, columns]; the cameras' pictures may differ in shape.
    points
        Places in the material picture (x, y) [px], shape [n, 2].
    rig
        The cameras, for these pictures (`StereoRig.cropped`).
    settings
        Of the match; its shape function must be AFFINE or QUADRATIC.
    noise
        Standard deviation of a grey value of both pictures [grey].
    reference_warp
        Total warps from the material picture to `picture0`, shape [n, 12]; a row with a NaN is a point that
        camera 0 has lost. None: `picture0` is the material picture.
    mask
        Pixels of the material picture that belong to the specimen, shape [rows, columns]; None: all.
    search
        Where first guesses are looked for.
    gates
        What a match must pass.
    device
        Where pictures are correlated, "cpu" or "cuda".

    Returns
    -------
    StereoMatch
        One row a point. A point that fails a gate is a STEREO_MISMATCH, one that was not matched in the first
        place keeps the outcome of the match.

    Raises
    ------
    ValueError
        A rigid shape function, shapes that do not fit, points or pictures that are not finite.
    """
    search, gates = search or StereoSearch(), gates or StereoGates()
    if settings.shape < Shape.AFFINE:
        raise ValueError("shape must be AFFINE or QUADRATIC: two cameras never see a surface undeformed")
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.all(np.isfinite(points)):
        raise ValueError(f"points must be finite and have shape [n, 2], got {points.shape}")
    reference = (
        np.zeros((len(points), 12)) if reference_warp is None else np.array(reference_warp, dtype=float)
    )
    if reference.shape != (len(points), 12):
        raise ValueError(f"reference_warp must have shape {(len(points), 12)}, got {reference.shape}")
    pictures = tuple(np.asarray(picture, dtype=np.float32) for picture in (picture0, picture1))
    stacks = tuple(
        PictureStack.prepare(picture[None], noise=noise, prefilter=settings.prefilter, device=device)
        for picture in pictures
    )
    known = np.all(np.isfinite(reference), axis=1)
    matcher = _Matcher(
        rig=rig,
        pictures=(pictures[0], pictures[1]),
        stacks=(stacks[0], stacks[1]),
        points=points[known],
        reference=reference[known],
        mask=None if mask is None else np.asarray(mask),
        settings=settings,
        search=search,
        gates=gates,
    )
    return _spread(matcher.run(), points, known)


@dataclass(frozen=True)
class _Matcher:
    """One call of `match_stereo`: what it was given."""

    rig: StereoRig
    pictures: tuple[NDArray[np.float32], NDArray[np.float32]]
    stacks: tuple[PictureStack, PictureStack]
    points: FloatArray
    reference: FloatArray
    mask: BoolArray | None
    settings: Correlation
    search: StereoSearch
    gates: StereoGates

    @property
    def places(self) -> FloatArray:
        """Where camera 0 sees the points [px], shape [n, 2]."""
        return warps.apply(self.points, self.reference)

    def run(self) -> StereoMatch:
        """Guesses, match, gates."""
        n = len(self.points)
        near = neighbourhood(self.points, self.search.neighbours)
        match = Match(
            np.zeros((n, 12)), np.zeros((n, 2, 2)), np.zeros(n), np.zeros(n, np.int64), np.zeros(n, np.int64)
        )
        found = np.zeros(n, dtype=np.bool_)
        guessed = found.copy()
        while True:  # a region that no neighbour leads to gets seeds of its own
            before = found.sum()
            self._seed(match, found)
            if found.sum() == before:
                break
            guessed |= propagate(match, self.points, near, self.search.attempts, self._attempt, found)
        match.outcome[~guessed] = PointOutcome.NO_FIRST_GUESS
        rows = np.flatnonzero(found)
        if self.settings.shape > Shape.AFFINE and len(rows):
            _write(match, rows, self._correlate(rows, match.warp[rows], self.settings))
        wrong = guessed & ~found & (match.outcome == PointOutcome.VALID)
        match.outcome[wrong] = PointOutcome.STEREO_MISMATCH  # converged where it cannot be
        return self._judged(match, near)

    def _seed(self, match: Match, found: BoolArray) -> None:
        """Search whole curves for points spread over those not found yet."""
        rows = _spread_out(self.points, ~found, self.search.seeds)
        side = self.search.subset or max(self.settings.subset, SEARCHED)
        wanted = subsets(self.pictures[0], self.points[rows], self.reference[rows], side, self.mask)
        turns = [(a, b) for a in self.search.stretching_turns for b in self.search.shearing_turns]
        limits = self.search.distances
        if limits is None and found.any():  # the rest of the surface is near what is known of it
            limits = _widened(self._distances(np.flatnonzero(found), match))
        candidates = search_curves(self.rig, wanted, self.pictures[1], limits=limits, turns=np.radians(turns))
        alone = 1.0 - candidates.zncc < self.search.distinct * (1.0 - candidates.rival)
        good = (candidates.zncc >= self.search.least_zncc) & alone
        result, believed = self._attempt(rows[good], candidates.warp[good])
        rows = rows[good][believed]
        _write(match, rows, result, believed)
        found[rows] = True

    def _attempt(self, rows: IntArray, guess: FloatArray) -> tuple[Match, BoolArray]:
        """An affine match, and which of them may hand on their warps."""
        result = self._correlate(rows, guess, replace(self.settings, shape=Shape.AFFINE))
        converged = result.outcome == PointOutcome.VALID
        moved = np.linalg.norm(result.warp[:, :2] - guess[:, :2], axis=1)
        epipolar, sigma = self._epipolar(rows, result)
        meets = np.abs(epipolar) <= self.gates.epipolar + self.gates.sigmas * sigma
        return result, converged & meets & (moved <= self.settings.subset / 2.0)

    def _correlate(self, rows: IntArray, guess: FloatArray, settings: Correlation) -> Match:
        return correlate(
            *self.stacks,
            self.points[rows],
            guess,
            settings,
            reference_warp=self.reference[rows],
            mask=self.mask,
        )

    def _epipolar(self, rows: IntArray, match: Match) -> tuple[FloatArray, FloatArray]:
        """Epipolar distance and its sigma [px]; inf where the match is none."""
        distance, sigma = np.full(len(rows), np.inf), np.zeros(len(rows))
        some = match.outcome == PointOutcome.VALID
        pixels = self.places[rows][some], warps.apply(self.points[rows], match.warp)[some]
        distance[some] = epipolar_distance(self.rig, *pixels)
        sigma[some] = epipolar_sigma(self.rig, *pixels, np.zeros((2, 2)), match.covariance[some])
        return distance, sigma

    def _distances(self, rows: IntArray, match: Match) -> FloatArray:
        """Of matched points along camera 0's lines of sight [m]."""
        places0, places1 = self.places[rows], warps.apply(self.points[rows], match.warp[rows])
        return distance_along(self.rig, places0, midpoint(self.rig, places0, places1))

    def _judged(self, match: Match, near: IntArray) -> StereoMatch:
        """The evidence for every match, and the verdict."""
        n = len(self.points)
        valid = match.outcome == PointOutcome.VALID
        rows = np.flatnonzero(valid)
        epipolar, epipolar_noise = self._epipolar(np.arange(n), match)
        facet, incidence, back, distinct, distance = (np.full(n, np.inf) for _ in range(5))
        sigma = np.zeros(n)
        if len(rows):
            places0 = self.places[rows]
            distance[rows] = self._distances(rows, match)
            A = slope(match.warp[rows]) @ np.linalg.inv(slope(self.reference[rows]))
            fit = fit_facet(self.rig, places0, distance[rows], A)
            facet[rows] = fit.across * (self.settings.subset / 2.0)
            incidence[rows] = np.maximum(*fit.incidence)
            sigma[rows], back[rows], distinct[rows] = self._both_ways(rows, match, A, distance[rows])
        disagree = neighbours_disagree(self.points, match.warp, near, valid)
        evidence = Evidence(epipolar, epipolar_noise, facet, incidence, back, disagree, distinct, distance)
        failed = np.where(
            valid, judge(evidence, sigma, self.gates, self.search.distances), int(Gate.CORRELATION)
        )
        outcome = np.where(valid & (failed != 0), int(PointOutcome.STEREO_MISMATCH), match.outcome)
        return StereoMatch(
            self.points, match.warp, match.covariance, match.zncc, outcome, failed.astype(np.int64), evidence
        )

    def _both_ways(
        self, rows: IntArray, match: Match, A: FloatArray, distance: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sigma, distance of the way back, ZNSSD over that of the best rival, each of shape [rows]."""
        points, reference, warp = self.points[rows], self.reference[rows], match.warp[rows]
        near, far = self.search.distances or _widened(distance)
        side = self.settings.subset
        there = search_curves(
            self.rig,
            subsets(self.pictures[0], points, reference, side, self.mask),
            self.pictures[1],
            limits=(near, far),
            gradients=A,
        )
        # the same span of space, seen from camera 1
        centres = [camera.centre for camera in self.rig.cameras]
        rays = directions(self.rig.cameras[0], warps.apply(points, reference))
        span = [np.linalg.norm(centres[0] + rays * s - centres[1], axis=1) for s in (near, far)]
        back = search_curves(
            replace(self.rig, cameras=self.rig.cameras[::-1], covariance=None),
            subsets(self.pictures[1], points, warp, side, self.mask),
            self.pictures[0],
            limits=(float(np.min(span)), float(np.max(span))),
            gradients=np.asarray(np.linalg.inv(A), dtype=np.float64),
        )
        again = correlate(
            *self.stacks[::-1],
            points,
            back.warp,
            self.settings,
            reference_warp=warp,
            mask=self.mask,
        )
        fine = again.outcome == PointOutcome.VALID
        off = np.linalg.norm(again.warp[:, :2] - reference[:, :2], axis=1)
        shares = []
        for candidates, home in ((there, warp), (back, reference)):
            best = (1.0 - candidates.zncc) / (1.0 - candidates.rival)
            reach = 2.0 + 2.0 * max(1, side // SAMPLES)  # steps of the curve, and half a speckle
            missed = ~(np.linalg.norm(candidates.warp[:, :2] - home[:, :2], axis=1) <= reach)
            shares.append(np.where(missed, np.inf, best))
        trace = np.trace(match.covariance[rows] + again.covariance, axis1=1, axis2=2)
        return np.sqrt(trace / 2.0), np.where(fine, off, np.inf), np.maximum(*shares)


def _widened(distance: FloatArray) -> tuple[float, float]:
    """Nearest and farthest of these distances, with a margin on either side [m]."""
    near, far = float(distance.min()), float(distance.max())
    margin = MARGIN * (far - near) + 0.002 * near  # a flat specimen has a span of nothing
    return max(near - margin, near / 2.0), far + margin


def _spread_out(points: FloatArray, wanted: BoolArray, number: int) -> IntArray:
    """Rows of about `number` wanted points, one a cell of a grid over them."""
    rows = np.flatnonzero(wanted)
    if len(rows) <= number:
        return rows
    low = points[rows].min(axis=0)
    extent = np.maximum(points[rows].max(axis=0) - low, 1.0)
    cell = np.sqrt(extent[0] * extent[1] / number)
    index = np.floor((points[rows] - low) / cell)
    off = np.linalg.norm((points[rows] - low) / cell - index - 0.5, axis=1)
    order = np.lexsort((off, index[:, 0], index[:, 1]))  # in each cell the point nearest to its middle
    first = np.r_[True, np.any(np.diff(index[order], axis=0) != 0.0, axis=1)]
    return rows[order[first]]


def _write(match: Match, rows: IntArray, result: Match, which: BoolArray | slice = slice(None)) -> None:
    for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
        getattr(match, name)[rows] = getattr(result, name)[which]


def _spread(part: StereoMatch, points: FloatArray, known: BoolArray) -> StereoMatch:
    """The result for all points: those that camera 0 has lost had nothing to start from."""
    if known.all():
        return part

    def whole(values: NDArray, fill: float) -> NDArray:
        result = np.full((len(points), *values.shape[1:]), fill, dtype=values.dtype)
        result[known] = values
        return result

    evidence = Evidence(**{name: whole(value, np.inf) for name, value in vars(part.evidence).items()})
    return StereoMatch(
        points=points,
        warp=whole(part.warp, 0.0),
        covariance=whole(part.covariance, 0.0),
        zncc=whole(part.zncc, 0.0),
        outcome=whole(part.outcome, int(PointOutcome.NO_FIRST_GUESS)),
        failed=whole(part.failed, int(Gate.CORRELATION)),
        evidence=evidence,
    )
