"""Tracking of a rigid body by one camera: one motion predicts all points and rejects false matches."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dic.basics import BoolArray, FloatArray, IntArray, median
from dic.correlation import Correlation, Match, Noise, PictureStack, Shape, Templates, correlate
from dic.correlation.subsets import gradient, identity
from dic.images import Pictures
from dic.outcome import FrameOutcome, PointOutcome
from dic.tracking import Track
from dic.tracking.frame_match import EVERY, TRIES
from dic.tracking.inputs import FramesAhead

APART = 0.5
"""Allowed distance of a point from its position by the body's motion, in addition to noise [px]."""
SIGMAS = 6.0
"""Allowed distance due to noise, in standard deviations of the point's match [-]."""
FEWEST = 5
"""Smallest number of points that must agree on a motion. Fewer points may agree by chance."""
BORDER = 1
"""Width of the border that is not matched [px]: the camera's filters are one-sided there. A shift of the
first row by a tenth of a pixel shifts a subset with five visible rows by a fiftieth of a pixel."""
UNLIKE, TIMES = 0.1, 6.0
"""Points that agree are taken for another body if 1 - ZNCC exceeds both limits [-]: an absolute value, and a
multiple of the median of the previous frames. A rigid body keeps its paint, and noise reduces the correlation
equally in all frames. Printed dots that are displaced by a few steps of their lattice have a correlation of
three quarters."""
SEARCHED = (1.5, -1.5, 3.0, -3.0, 5.0, -5.0)
"""If too few points are found at the prediction, these steps along each axis are tried [px]. A body that has
been lost for some frames is searched at the prediction alone in most frames, as lost points are."""
MOST_TOGETHER = 4096
"""Largest number of points that are matched in one launch from several start positions."""


def track_rigid(
    pictures: Pictures,
    points: FloatArray,
    settings: Correlation,
    *,
    noise: float | Noise,
    mask: BoolArray | None = None,
    start: FloatArray | None = None,
    start_covariance: FloatArray | None = None,
    first: int = 0,
    frame_outcome: IntArray,
    device: str = "cpu",
    progress: Callable[[int, int], None] | None = None,
) -> Track:
    """Track a translating body from one picture forward to the end and back to the beginning.

    The reference is always the picture of frame `first`, so there is no drift. A subset that extends past the
    border of a picture is matched by its visible part, if this is at least `Correlation.least_pixels`. The
    outermost pixels are not used.

    ``points``: positions in the material picture (x, y) [px], shape [n_points, 2]. ``settings``: settings of
    the match; the shape function is replaced by RIGID. ``mask``: pixels of the body in the material picture,
    shape [rows, columns]. ``start``: total warps of the points in frame `first`, shape [n_points, 12]; None:
    that frame is the material picture. ``start_covariance``: covariance of the positions given by `start`
    [px²], shape [n_points, 2, 2]. ``first``: frame in which the points are known. ``frame_outcome``:
    `FrameOutcome` of the pictures, shape [n_frames]. Raises PictureError if the picture of frame `first`
    cannot be read.
    """
    n_frames, n = len(frame_outcome), len(points)
    root = identity(n) if start is None else np.asarray(start, dtype=np.float64)
    common = np.zeros((n, 2, 2)) if start_covariance is None else np.asarray(start_covariance)
    settings = replace(settings, shape=Shape.RIGID)
    inner, within = points - BORDER, None if mask is None else mask[BORDER:-BORDER, BORDER:-BORDER]
    frames = FramesAhead(pictures, noise=noise, prefilter=settings.prefilter, device=device, border=BORDER)
    stack, templates = frames.prepared(first, pictures.frame(first)), Templates.of(n, settings)
    result = Track.empty(points, first, np.array(frame_outcome))
    result.warp[first], result.covariance[first], result.zncc[first] = root, common, 1.0
    result.outcome[first] = int(PointOutcome.VALID)
    orders = [range(first + 1, n_frames), range(first - 1, -1, -1)]
    usable = [[k for k in order if frame_outcome[k] == FrameOutcome.VALID] for order in orders]
    frames.expect([*usable[0], *usable[1]])
    try:
        count = 1
        for order in orders:
            history, unlike, lost = [(first, np.zeros(2))], list[float](), 0
            for frame in order:
                count += 1
                if progress is not None:
                    progress(count, n_frames)
                picture = frames.read(frame) if frame_outcome[frame] == FrameOutcome.VALID else None
                if picture is None:
                    continue
                expected, most = _predicted(history, frame), most_unlike(unlike)
                steps = SEARCHED if lost < TRIES or lost % EVERY == 0 else ()
                move = _step(
                    result, frame, stack, frames.prepared(frame, picture), inner, root, common, settings,
                    within, templates, expected, most, steps,
                )  # fmt: skip
                lost = 0 if move is not None else lost + 1
                if move is not None:
                    history = [*history[-1:], (frame, move)]
                    fine = result.outcome[frame] == PointOutcome.VALID
                    unlike.append(1.0 - float(median(result.zncc[frame, fine])))
    finally:
        frames.close()
    return result


def most_unlike(before: Sequence[float]) -> float:
    """Largest median of 1 - ZNCC at which points are taken for the same body [-]."""
    return max(UNLIKE, TIMES * float(np.median(before))) if before else 1.0


def _predicted(history: list[tuple[int, FloatArray]], frame: int) -> FloatArray:
    """Predicted displacement of the body from the reference at constant velocity [px], shape [2]."""
    last, move = history[-1]
    if len(history) < 2:
        return move
    before, earlier = history[-2]
    return np.asarray(move + (move - earlier) * (frame - last) / (last - before))


def _step(
    result: Track,
    frame: int,
    stack: PictureStack,
    current: PictureStack,
    points: FloatArray,
    root: FloatArray,
    common: FloatArray,
    settings: Correlation,
    mask: BoolArray | None,
    templates: Templates | None,
    predicted: FloatArray,
    most: float,
    steps: Sequence[float],
) -> FloatArray | None:
    """Match the points in one frame. Returns the body's displacement from the reference [px], None if no
    motion is found."""
    best, matches = None, _matches(stack, current, points, root, [predicted], settings, mask, templates)
    for k in range(1 + len(steps)):
        if k == 1:  # the prediction failed: try all other steps at once
            displaced = [predicted + off * np.eye(2)[axis] for off in steps for axis in (1, 0)]
            matches = _matches(stack, current, points, root, displaced, settings, mask, templates)
        for match in matches[2 * k - 2 : 2 * k] if k else matches:
            fine = match.outcome == PointOutcome.VALID
            move = match.warp[:, :2] - root[:, :2]
            if fine.any():
                middle = median(move[fine])
                sigma = np.sqrt(0.5 * np.trace(match.covariance, axis1=1, axis2=2))
                agree = fine & (np.linalg.norm(move - middle, axis=1) <= APART + SIGMAS * sigma)
                if agree.any() and 1.0 - float(median(match.zncc[agree])) > most:
                    agree[:] = False
                if best is None or agree.sum() > best[0].sum():
                    best = (agree, match, median(move[agree]) if agree.any() else middle)
        inside = match.outcome != PointOutcome.OUT_OF_VIEW
        if best is not None and best[0].sum() >= max(1.0, 0.5 * inside.sum()):
            break
    agree, match, middle = (np.zeros(len(points), dtype=bool), match, predicted) if best is None else best
    if agree.sum() < FEWEST:
        agree[:] = False
    outcome = match.outcome.copy()
    outcome[(outcome == PointOutcome.VALID) & ~agree] = int(PointOutcome.LOW_CORRELATION)
    result.warp[frame], result.zncc[frame], result.outcome[frame] = match.warp, match.zncc, outcome
    result.covariance[frame] = match.covariance + common
    return np.asarray(middle) if agree.any() else None


def _matches(
    stack: PictureStack,
    current: PictureStack,
    points: FloatArray,
    root: FloatArray,
    moves: list[FloatArray],
    settings: Correlation,
    mask: BoolArray | None,
    templates: Templates | None,
) -> list[Match]:
    """Matches that start from several motions of the body [px], in as few launches as possible."""
    guesses = np.tile(root, (len(moves), 1, 1))
    guesses[:, :, :2] += np.array(moves)[:, None]
    # before the body enters the picture, no point is in view
    seen = _in_view(np.tile(points, (len(moves), 1)), guesses.reshape(-1, 12), current.shape, settings)
    rows = [np.flatnonzero(one) for one in seen.reshape(len(moves), -1)]
    matches = [_out_of_view(guess) for guess in guesses]
    each = max(1, MOST_TOGETHER // len(points))
    for first in range(0, len(moves), each):
        some = range(first, min(first + each, len(moves)))
        of = np.concatenate([rows[k] for k in some])
        if not of.size:
            continue
        part = correlate(
            stack, current, points[of], np.concatenate([guesses[k][rows[k]] for k in some]), settings,
            reference_warp=root[of], mask=mask, templates=templates, template_rows=of,
            threads=None if len(some) == 1 else 1,  # two threads may not fill the template of one point
        )  # fmt: skip
        ends = np.cumsum([0, *(rows[k].size for k in some)])
        for k, begin, end in zip(some, ends[:-1], ends[1:], strict=True):
            for name in ("warp", "covariance", "zncc", "iterations", "outcome"):
                getattr(matches[k], name)[rows[k]] = getattr(part, name)[begin:end]
    return matches


def _in_view(
    points: FloatArray, warp: FloatArray, shape: tuple[int, int], settings: Correlation
) -> BoolArray:
    """Points whose warped subsets lie sufficiently within a picture of this shape, [n]."""
    half = 0.5 * settings.subset
    bend = np.abs(warp[:, 6:].reshape(-1, 2, 3)) @ np.array([0.5, 1.0, 0.5])
    share = max(1.0 - 2.0 * settings.least_pixels, 0.0)
    beyond = share * half * np.abs(gradient(warp)).sum(axis=2) + half**2 * bend + 1.0
    place = points + warp[:, :2]
    return np.asarray(np.all((place > -beyond) & (place < np.array(shape[::-1]) - 1.0 + beyond), axis=1))


def _out_of_view(guess: FloatArray) -> Match:
    """Result for warps with which no subset lies in the picture."""
    n = len(guess)
    return Match(
        warp=guess,
        covariance=np.zeros((n, 2, 2)),
        zncc=np.zeros(n),
        iterations=np.zeros(n, dtype=np.int64),
        outcome=np.full(n, int(PointOutcome.OUT_OF_VIEW)),
    )
