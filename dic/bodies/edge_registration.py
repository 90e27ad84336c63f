"""Position of a body with only an edge strip visible at rest.

The strip has too few rows for a subset, but it moves as a rigid body. The static pictures of both cameras are
compared pixel by pixel with the material picture. The only unknown is the translation along the axis. The
outermost rows of a picture are shifted inward by a fraction of a pixel; `EdgeRegistration.fit_row_offsets`
measures this.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from dic.basics import BoolArray, FloatArray, IntArray, zncc
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.images import PictureError, Pictures
from dic.stereo.geometry import pixels_per_length
from dic.surfaces.cylinder import SpecimenFrame

EDGE_ROWS = 12
"""Number of compared rows, from the border at which the body enters the picture."""


FEWEST = 40
"""Smallest number of pixels of both cameras that must show the body."""
LEAST_ZNCC = 0.9
"""Smallest ZNCC of a strip that is accepted as the body, independent of other frames."""
UNLIKE, TIMES = 0.03, 6.0
"""A strip is rejected if 1 - ZNCC exceeds both limits [-]: an absolute value, and a multiple of the median of
frames with known translation. For speckles of about four pixels, an error of half a pixel gives 0.03. Noise
gives the same value in all frames."""


@dataclass(frozen=True)
class EdgeView:
    """The edge strip as one camera sees it, and its material picture."""

    camera: Camera
    coefficients: FloatArray
    """Quintic spline of the picture in which the points were chosen, shape [rows, columns]."""
    x: IntArray
    """Pixels of the edge strip (x, y), shape [n, 2]."""
    X: FloatArray
    """Intersections of their rays with the body's cylinder, in the test frame [m], shape [n, 3]. Rays that
    miss the cylinder are left out."""
    row: IntArray
    """Their rows, counted from the border at which the body enters, shape [n]."""

    def grey(self, places: FloatArray) -> FloatArray:
        """Grey values of the picture in which the points were chosen [grey], at positions (x, y) [px]."""
        at = places[:, ::-1].T
        grey = ndimage.map_coordinates(self.coefficients, at, order=5, mode="mirror", prefilter=False)
        return np.asarray(grey)


@dataclass(frozen=True)
class VisiblePixels:
    """The pixels of a camera that show the body, and the corresponding values of the material picture."""

    view: EdgeView
    X: FloatArray
    """Their positions on the body at the time of the material picture, in the test frame [m], shape [n,
    3]."""
    grey: FloatArray
    """Grey values of the pixels, shape [n]."""
    reference: FloatArray
    """Grey values of the same positions in the material picture, shape [n]."""
    row: IntArray
    """The pixels' rows from the border, shape [n]."""

    def slope(self, frame: SpecimenFrame, step: float) -> FloatArray:
        """Derivative of `reference` with respect to the translation along y [grey/m], shape [n]: a difference
        quotient over `step` [m]."""
        displaced = self.view.camera.project(frame.in_rig(self.X - [0.0, step, 0.0]))
        return (self.view.grey(displaced) - self.reference) / step


def _zncc_of(grey: Sequence[FloatArray], reference: Sequence[FloatArray]) -> float:
    """ZNCC over the pixels of both cameras; -1 for too few pixels, or constant grey values."""
    f, g = np.concatenate(grey), np.concatenate(reference)
    return zncc(f, g) if len(f) >= FEWEST else -1.0


def least_zncc(values: Sequence[float]) -> float:
    """Smallest ZNCC at which a strip is accepted as the body's.

    ``values``: ZNCC in the frames in which the body's translation is known.
    """
    if not values:
        return LEAST_ZNCC
    return max(LEAST_ZNCC, 1.0 - max(UNLIKE, TIMES * (1.0 - float(np.median(values)))))


def fitted(
    grey: FloatArray, reference: FloatArray, slope: FloatArray, of: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least-squares step of y [m] in ``grey = gain (reference + slope step) + offset`` with free gain and
    offset, and its variance, for several groups of pixels. ``of``: 1 for the pixels of a group, else 0, shape
    [n_groups, n]. The variance is infinite where grey values are constant, or with less than four pixels."""
    n = of.sum(axis=1)
    f, g = (of * (values - (of @ values / np.maximum(n, 1.0))[:, None]) for values in (grey, reference))
    cross, energy = np.sum(f * g, axis=1), np.sum(g * g, axis=1)
    known = (energy > 0.0) & np.any(f != 0.0, axis=1) & (n > 3.0)
    gain = np.where(known, cross / np.where(known, energy, 1.0), 0.0)
    A = np.stack([1e-6 * gain[:, None] * (of * slope), g, of], axis=2)  # the step in micrometres
    inverse = np.linalg.pinv(np.swapaxes(A, 1, 2) @ A)
    solution = inverse @ (np.swapaxes(A, 1, 2) @ grey[:, None])
    scatter = np.sum((of * grey - (A @ solution)[..., 0]) ** 2, axis=1) / np.maximum(n - 3.0, 1.0)
    step, variance = 1e-6 * solution[:, 0, 0], 1e-12 * scatter * inverse[:, 0, 0]
    return np.where(known, step, 0.0), np.where(known, variance, np.inf)


def rays_on_body(
    camera: Camera,
    pixels: FloatArray,
    frame: SpecimenFrame,
    radius: float,
    across: FloatArray | tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> FloatArray:
    """Intersections of the rays of pixels with a cylinder about the axis, in the test frame [m], shape [n,
    3]; NaN for rays that miss it.

    ``camera``, ``frame``: the camera and the test frame. ``pixels``: pixels (x, y) [px], shape [n, 2].
    ``radius``: radius of the cylinder [m]. ``across``: a point of its axis in the test frame [m], shape [3].
    """
    ideal = camera.undistort(pixels)
    rays = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1) @ camera.rotation
    centre = frame.positions(camera.centre)
    start = centre - np.asarray(across)
    d = rays @ frame.rotation.T
    a = d[:, 0] ** 2 + d[:, 2] ** 2
    b = d[:, 0] * start[0] + d[:, 2] * start[2]
    under = b * b - a * (start[0] ** 2 + start[2] ** 2 - radius**2)
    depth = np.where(under >= 0.0, (-b - np.sqrt(np.maximum(under, 0.0))) / a, np.nan)
    return np.asarray(centre + depth[:, None] * d)


def _edge_view(
    camera: Camera, material: FloatArray, frame: SpecimenFrame, radius: float, outward: FloatArray
) -> EdgeView:
    """The edge strip in one camera; the body enters at the border in the direction `outward` (x, y)."""
    rows, columns = material.shape
    y, x = np.mgrid[0:rows, 0:columns]
    axis = int(np.argmax(np.abs(outward)))
    along = (x, y)[axis]
    row = (columns, rows)[axis] - 1 - along if outward[axis] > 0.0 else along
    near = row < EDGE_ROWS
    pixels = np.stack([x[near], y[near]], axis=1).astype(np.float64)
    X = rays_on_body(camera, pixels, frame, radius)
    smooth = ndimage.spline_filter(np.asarray(material, dtype=np.float64), order=5, mode="mirror")
    hit = np.isfinite(X).all(axis=1)
    return EdgeView(camera, smooth, pixels[hit].astype(np.int64), X[hit], row[near][hit].astype(np.int64))


def _visible_pixels(
    view: EdgeView,
    picture: FloatArray,
    first: Camera,
    frame: SpecimenFrame,
    inner: BoolArray,
    motion: FloatArray,
    offset: FloatArray,
) -> VisiblePixels:
    """The pixels that show the body, mapped by `motion` to the material picture."""
    X = view.X + motion
    X[:, 1] -= offset[view.row]
    chosen = first.project(frame.in_rig(X))
    at = np.round(chosen).astype(np.int64)
    rows, columns = inner.shape
    within = (at[:, 0] >= 0) & (at[:, 0] < columns) & (at[:, 1] >= 0) & (at[:, 1] < rows)
    within[within] = inner[at[within, 1], at[within, 0]]
    pixels = chosen[within] if view.camera is first else view.camera.project(frame.in_rig(X[within]))
    inside = np.all((pixels >= 3.0) & (pixels <= np.array([columns, rows]) - 4.0), axis=1)
    visible = np.flatnonzero(within)[inside]
    x, y = view.x[visible].T
    return VisiblePixels(view, X[visible], picture[y, x], view.grey(pixels[inside]), view.row[visible])


LARGEST_EDGE = 0.1
"""The row at the region's end may be used only if its error in frames with known translation is at most this
[px]. It is used if no other row is in view. The blur of the body's edge causes a larger error."""
FEWEST_ROW = 20
"""Smallest number of pixels of a row that must show the body for an estimate of the row's offset."""
FEWEST_FRAMES = 3
"""Smallest number of frames in which a row must show the body."""
SEARCH_STEP = 0.18
"""Step of the translations that are tried [px]: a fraction of a speckle."""
TOGETHER = 32
"""Largest number of translations that are tried together: the memory grows with it."""
MOST_STEPS, CONVERGED = 10, 2e-4
"""Largest number of Gauss-Newton steps, and the step size at which they end [px]."""
LARGEST_CORRECTION = 0.54
"""Largest distance of the result from the best one of the tried translations [px]."""
SLOPE_STEP = 0.02
"""Step of the difference quotient of grey values [px]."""


@dataclass(frozen=True)
class RegisteredEdge:
    """A translation of the body by registration of its edge strip."""

    y: float
    """Translation along the axis [m]."""
    sigma: float
    """Its standard deviation, from the residual of the comparison [m]."""
    common: float
    """Further standard deviation, common to frames that show the same rows [m]. It comes from the uncertainty
    of the rows' offsets, and of the row at the region's end if this row is used."""
    clear: bool
    """False if too few rows are clear of the region's end. Then the row at the end is used too."""
    zncc: float
    """ZNCC of the edge strip."""
    n_pixels: int
    """Number of pixels that show the strip."""


class EdgeRegistration:
    """Registration of the edge strip of a body of revolution with its material picture, in any frame.

    ``material``: pictures of camera 0 and camera 1 at the time when the body's points were chosen, shape
    [rows, columns] each. ``mask``: pixels of the body in camera 0's picture of that time, shape [rows,
    columns]. ``rig``, ``frame``: the cameras and the test frame. The body is a body of revolution about the y
    axis of this frame. ``places``: points of its surface at translation zero, in the test frame [m], shape
    [n, 3]. ``move``: translation at the time of `material` [m], shape [3].
    """

    def __init__(
        self,
        material: tuple[FloatArray, FloatArray],
        mask: BoolArray,
        rig: StereoRig,
        frame: SpecimenFrame,
        places: FloatArray,
        move: FloatArray,
    ) -> None:
        radius = float(np.median(np.hypot(places[:, 0], places[:, 2])))
        self._masks = (mask, ndimage.binary_erosion(mask, border_value=1))
        self._first, self._frame, self._move = rig.cameras[0], frame, move
        middle = np.median(places, axis=0) + move
        along = pixels_per_length(rig.cameras[0], frame.in_rig(middle), frame.rotation[1])
        self.pixel = 1.0 / float(np.linalg.norm(along))
        """Length along the axis that a pixel shows [m]."""
        self._views = [
            _edge_view(*camera_and_pixels, frame, radius, along)
            for camera_and_pixels in zip(rig.cameras, material, strict=True)
        ]
        self._offset, self._offset_sigma = np.zeros((2, EDGE_ROWS)), np.zeros((2, EDGE_ROWS))
        self._least = LEAST_ZNCC

    def fit_row_offsets(
        self, matched_frames: Iterable[tuple[tuple[FloatArray, FloatArray], FloatArray]]
    ) -> tuple[FloatArray, FloatArray]:
        """Estimate the offset of each row at the border. `register` subtracts these offsets. It rejects
        strips whose correlation is much lower than in these frames.

        ``matched_frames``: pairs of pictures, shape [rows, columns] each, with the body's translation in them
        [m], shape [3]. Returns: offsets along y of each camera's rows from the border inward [m], shape [2,
        `EDGE_ROWS`]; 0 where unknown. Returns: its standard deviation, from the scatter of the frames [m],
        same shape.
        """
        frames = [self._row_offsets(pictures, move) for pictures, move in matched_frames]
        self._least = least_zncc([zncc for _, zncc in frames if zncc > 0.0])
        offset = np.stack([offsets for offsets, _ in frames])  # frame, camera, row
        count = np.isfinite(offset).sum(axis=0)
        enough = count >= FEWEST_FRAMES
        values = np.where(np.isfinite(offset), offset, 0.0)
        mean = values.sum(axis=0) / np.maximum(count, 1)
        square = np.where(np.isfinite(offset), (offset - mean) ** 2, 0.0).sum(axis=0)
        self._offset = np.where(enough, mean, 0.0)
        self._offset_sigma = np.where(enough, np.sqrt(square / np.maximum(count * (count - 1), 1)), 0.0)
        return self._offset, self._offset_sigma

    def register(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, tried: FloatArray
    ) -> RegisteredEdge | None:
        """Translation of the body in a pair of pictures.

        ``pictures``: of camera 0 and camera 1, shape [rows, columns] each. ``near``: a translation across the
        axis (x and Z count) [m], shape [3]. ``tried``: start values of the translation along the axis,
        increasing or decreasing [m], shape [n]. Returns: None if too few pixels show the body, or no start
        value gives a sufficient correlation.
        """
        whole, clear = self._masks
        parts = np.array_split(tried, -(-len(tried) // TOGETHER))
        score = np.concatenate([self._scores(pictures, near, part, whole) for part in parts])
        best = int(np.argmax(score))
        if score[best] < 0.0:
            return None
        y, fit = self._converged(pictures, near, float(tried[best]), clear)
        is_clear = fit[-1] >= FEWEST
        if not is_clear:
            y, fit = self._converged(pictures, near, float(tried[best]), whole)
        zncc, _, variance, offset, n = fit
        if zncc < self._least or abs(y - tried[best]) > LARGEST_CORRECTION * self.pixel:
            return None
        return RegisteredEdge(
            y=y, sigma=float(np.sqrt(variance)), common=offset, zncc=zncc, n_pixels=n, clear=is_clear
        )

    def end_error(
        self, matched_frames: Iterable[tuple[tuple[FloatArray, FloatArray], FloatArray]]
    ) -> float | None:
        """Error of the body's position from the row at the region's end, in frames with known translation
        [m].

        ``matched_frames``: pairs of pictures with the body's translation, as in `fit_row_offsets`. They must
        show this row. Returns: root mean square, including the mean. None if fewer than `FEWEST_FRAMES`
        frames show the row, or if the error exceeds `LARGEST_EDGE`.
        """
        end = self._masks[0] & ~self._masks[1]
        steps = []
        for pictures, move in matched_frames:
            parts = self._visible(pictures, move, move[1:2], end)
            if sum(len(part.grey) for part in parts) < FEWEST:
                continue
            grey = np.concatenate([part.grey for part in parts])
            reference = np.concatenate([part.reference for part in parts])
            slope = np.concatenate([part.slope(self._frame, SLOPE_STEP * self.pixel) for part in parts])
            steps.append(float(fitted(grey, reference, slope, np.ones((1, len(grey))))[0][0]))
        error = float(np.sqrt(np.mean(np.square(steps)))) if len(steps) >= FEWEST_FRAMES else np.inf
        return error if error <= LARGEST_EDGE * self.pixel else None

    def _converged(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> tuple[float, tuple[float, float, float, float, int]]:
        """Best-fit translation by Gauss-Newton from y [m], and the result of `_compare` there."""
        for _ in range(MOST_STEPS):
            fit = self._compare(pictures, near, y, mask)
            longest = SEARCH_STEP * self.pixel
            step = float(np.clip(fit[1], -longest, longest))
            if abs(step) < CONVERGED * self.pixel:
                break
            y += step
        return y, fit

    def _row_offsets(
        self, pictures: tuple[FloatArray, FloatArray], move: FloatArray
    ) -> tuple[FloatArray, float]:
        """Offset of each row along y from `move` [m], shape [2, `EDGE_ROWS`]; NaN: not known. And the strip's
        ZNCC, -1 for too few pixels."""
        off, parts = np.full((2, EDGE_ROWS), np.nan), []
        for camera, (view, picture) in enumerate(zip(self._views, pictures, strict=True)):
            visible = _visible_pixels(
                view,
                picture,
                self._first,
                self._frame,
                self._masks[1],
                self._move - move,
                np.zeros(EDGE_ROWS),
            )
            parts.append(visible)
            slope = visible.slope(self._frame, SLOPE_STEP * self.pixel)
            of = (visible.row == np.arange(EDGE_ROWS)[:, None]).astype(np.float64)
            step, variance = fitted(visible.grey, visible.reference, slope, of)
            known = (of.sum(axis=1) >= FEWEST_ROW) & np.isfinite(variance)
            off[camera] = np.where(known, step, np.nan)
        return off, _zncc_of([part.grey for part in parts], [part.reference for part in parts])

    def _scores(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, tried: FloatArray, mask: BoolArray
    ) -> FloatArray:
        """ZNCC of the strip at each of the translations `tried`, shape [n]."""
        parts, first = self._visible(pictures, near, tried, mask), EDGE_ROWS * np.arange(1, len(tried))
        ends = [np.searchsorted(part.row, first) for part in parts]
        grey = [np.split(part.grey, at) for part, at in zip(parts, ends, strict=True)]
        model = [np.split(part.reference, at) for part, at in zip(parts, ends, strict=True)]
        return np.array([_zncc_of([f[k] for f in grey], [g[k] for g in model]) for k in range(len(tried))])

    def _visible(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: FloatArray, mask: BoolArray
    ) -> list["VisiblePixels"]:
        """Pixels of both cameras that show the body at translations y, shape [n]. The rows of the k-th
        translation are counted from k `EDGE_ROWS`."""
        n, parts = len(y), []
        motion = np.tile(self._move - near, (n, 1))
        motion[:, 1] = self._move[1] - y
        for view, picture, offset in zip(self._views, pictures, self._offset, strict=True):
            row = (EDGE_ROWS * np.arange(n)[:, None] + view.row).ravel()
            strips = replace(view, x=np.tile(view.x, (n, 1)), X=np.tile(view.X, (n, 1)), row=row)
            moved = np.repeat(motion, len(view.X), axis=0)
            parts.append(
                _visible_pixels(strips, picture, self._first, self._frame, mask, moved, np.tile(offset, n))
            )
        return parts

    def _compare(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> tuple[float, float, float, float, int]:
        """Five numbers at a translation y. They are the correlation, the Gauss-Newton step of y [m], its
        variance, the part of the rows' offsets in its sigma [m], and the number of pixels."""
        parts = self._visible(pictures, near, np.array([y]), mask)
        grey = np.concatenate([part.grey for part in parts])
        reference = np.concatenate([part.reference for part in parts])
        zncc, n = _zncc_of([grey], [reference]), len(grey)
        if zncc <= -1.0:
            return -1.0, 0.0, np.inf, 0.0, n
        slope = np.concatenate([part.slope(self._frame, SLOPE_STEP * self.pixel) for part in parts])
        (step,), (variance,) = fitted(grey, reference, slope, np.ones((1, n)))
        weight = slope**2 / float(slope @ slope)
        correlations = np.concatenate(
            [sigma[part.row] for sigma, part in zip(self._offset_sigma, parts, strict=True)]
        )
        # An offset is common to its row's pixels. The sum of the absolute values over rows is the upper
        # bound.
        return zncc, float(step), float(variance), float(weight @ correlations), n


SEARCH_RANGE = 0.9
"""Half width of the interval about the prediction in which the edge strip is searched [px]."""


MOST_OFFSET_FRAMES = 40
"""Largest number of frames from which the offsets of the rows at the picture's border are estimated."""


MOST_RECENT = 12
"""Number of frames from which the error of the row at the region's end is estimated."""


def registered_edges(
    pictures: tuple[Pictures, Pictures],
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    places: FloatArray,
    moves: FloatArray,
    rows: list[int],
    positions: list[float],
    static: BoolArray,
) -> list[tuple[int, RegisteredEdge]]:
    """The frames before the first of `rows`, latest first, with the registration of the edge strip."""
    first, m = rows[0], body.material
    twice = np.flatnonzero(np.isfinite(moves).all(axis=1))
    near = moves[twice[0]]
    if not np.isfinite(moves[m]).all() or first < 1:
        return []
    chosen = (pictures[0].frame(m).astype(np.float64), pictures[1].frame(m).astype(np.float64))
    registration = EdgeRegistration(chosen, body.mask, rig, frame, places, moves[m])
    registration.fit_row_offsets(_in_view(pictures, moves, rows, positions))
    result: list[tuple[int, RegisteredEdge]] = []
    recent: list[tuple[tuple[FloatArray, FloatArray], FloatArray]] = []
    end_error: float | None = None
    # Few points are in view at first, so the motion is estimated from the first ten frames together.
    at, y = np.array(rows[:10], dtype=np.float64), np.array(positions[:10])
    speed = float(np.median(np.diff(y) / np.diff(at))) if at.size > 1 else 0.0
    start = float(np.median(y - speed * (at - first)))
    past = [(first, start), (first + 1, start + speed)]
    for k in range(first - 1, -1, -1):
        try:
            pair = (pictures[0].frame(k).astype(np.float64), pictures[1].frame(k).astype(np.float64))
        except PictureError:
            continue  # the frame's outcome reports this (`dic.images.frame_health`)
        (last, latest), (before, earlier) = past
        speed = 0.0 if static[k] else (latest - earlier) / (last - before)
        expected = latest + speed * (k - last)
        settled = static[k] and static[min(k + 1, len(static) - 1)] and last == k + 1
        around = SEARCH_STEP if settled else SEARCH_RANGE * (last - k)
        tried = np.arange(-around, around + 0.5 * SEARCH_STEP, SEARCH_STEP) * registration.pixel
        edge = registration.register(pair, near, expected + tried)
        if edge is None:
            continue
        if edge.clear:
            recent = [(pair, np.array([near[0], edge.y, near[2]])), *recent[: MOST_RECENT - 1]]
        else:
            end_error = registration.end_error(recent) if end_error is None else end_error
            if end_error is None:
                break  # the visible part of the body is too close to its edge
            edge = replace(edge, common=float(np.hypot(edge.common, end_error)))
        result.append((k, edge))
        past = [(k, edge.y), past[0]]
    return result


def consistent_frames(
    rows: list[int], positions: list[float], counts: list[int], static: BoolArray, distance: float
) -> list[bool]:
    """True for frames that agree with the path of the later ones.

    While a body enters the picture, a few of its points may agree on a wrong position. Frames are checked
    from the one with the most points back to rest. A frame is left out if its distance from the line through
    the next frames exceeds `distance` [m], or half a step. The body accelerates from rest. A static frame is
    therefore left out if it lies more than `distance` beyond that line, or on the other side of the next
    frame.
    """
    fine = [True] * len(rows)
    if not rows:
        return fine
    best = int(np.argmax(counts))
    consistent = [best]
    for i in range(best - 1, -1, -1):
        after = consistent[-6:]
        if len(after) >= 3:
            at, y = np.array([rows[k] for k in after]), np.array([positions[k] for k in after])
            speed = float(np.median(np.diff(y) / np.diff(at)))
            if static[rows[i]]:
                fine[i] = at_rest_before(positions[i] - y[-1], speed * (rows[i] - at[-1]), distance)
            else:
                off = positions[i] - float(np.median(y + speed * (rows[i] - at)))
                fine[i] = abs(off) <= max(distance, 0.5 * abs(speed))
        if fine[i]:
            consistent.append(i)
    return fine


def at_rest_before(change: float, most: float, distance: float) -> bool:
    """Whether the position in a static frame is a possible position at rest."""
    low, high = min(most, 0.0), max(most, 0.0)
    return low - distance <= change <= high + distance


def _in_view(
    pictures: tuple[Pictures, Pictures], moves: FloatArray, rows: list[int], positions: list[float]
) -> Iterator[tuple[tuple[FloatArray, FloatArray], FloatArray]]:
    """Pictures and translations of about `MOST_OFFSET_FRAMES` frames whose points give the translation."""
    finite = [(k, y) for k, y in zip(rows, positions, strict=True) if np.isfinite(moves[k]).all()]
    for k, y in finite[:: max(len(finite) // MOST_OFFSET_FRAMES, 1)]:
        try:
            pair = (pictures[0].frame(k).astype(np.float64), pictures[1].frame(k).astype(np.float64))
        except PictureError:
            continue
        yield pair, np.array([moves[k, 0], y, moves[k, 2]])
