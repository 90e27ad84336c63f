"""Edges between bodies in a picture, by rigid motion or by correlation of rows; the arc of a rim.

Pictures shifted with the flyer agree in the rows of the flyer and disagree in those of the specimen. At rest,
adjacent rows of one body correlate, but two rows on either side of an end do not. A camera outside the plane
of an end sees its circle as an arc. A robust parabola is fitted to this arc.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import least_squares

from dic.basics import FloatArray, IntArray, zncc
from dic.images import PictureError, Pictures

STRIP = 8
"""Rows at the border that are tracked first [px]."""
FEWEST_ROWS = 4
"""Smallest number of rows of the flyer in view for an estimate of its position [px]."""
FEWEST_FRAMES = 5
"""Smallest number of frames that must show a row for its standard deviation to be used."""
LEAST_TRAVEL = 3.0
"""Smallest travel of a body that is taken as the flyer [px]."""
LARGEST_SPAN = 0.3
"""Largest travel over which pictures are compared, as a share of their rows."""
LEAST_ZNCC = 0.85
"""Smallest correlation of the flyer's rows from frame to frame."""
RIGID = 1.4
"""After the shift with the flyer, its rows vary by less than this number of standard deviations of the
noise."""
PLACED = 0.1
"""Error of the shift that is left, from warm air and interpolation [px]. The variation that it causes is
added to the limit. At the edges of sharp speckles a twentieth of a pixel causes more variation than the
noise."""
DEPARTS = 2.0
"""The edge is at the first row whose variation is this many times that of the flyer's rows."""
EDGE_SHARE = 0.3
"""The edge is where the variation reaches this share of the variation in the rows beyond. The share is below
one half, because the specimen's adjacent rows move almost with the flyer."""
WIDTH = 3
"""Number of rows beyond the edge whose variation represents that of the specimen."""
CLEAR = 3.0
"""Smallest ratio of the variation just beyond the flyer's edge to that of the flyer's rows."""
SPANS = 16
"""Number of travels that are tried, from the longest to the shortest."""
MOST_ROWS = 40
"""Largest number of rows of the flyer that are tracked."""
FINE_STEPS = 4
"""Number of Gauss-Newton steps for a shift."""


@dataclass(frozen=True)
class FollowedEdge:
    """The edge of the flyer in the frames that show enough of it."""

    frames: IntArray
    """Indices in the given list of frames, the last first, shape [n]."""
    row: FloatArray
    """Row of the edge in each frame, in pixel centres from the border at which the flyer enters [px], shape
    [n]."""
    contrast: float
    """Standard deviation over the frames beyond the edge over that within the flyer [-]."""


def follow_edge(pictures: FloatArray, noise: float) -> FollowedEdge:
    """Track the edge of a flyer that enters at the first row.

    ``pictures``: grey values of successive frames, corrected for uneven light, with the flyer at the top,
    shape [n_frames, rows, columns]. ``noise``: standard deviation of their noise.
    """
    n, rows, _ = pictures.shape
    travel, first = _coarse_travel(pictures)
    if travel[first] < LEAST_TRAVEL:
        raise ValueError(
            f"what the first {STRIP} rows of the last usable picture show moved by {travel[first]:.1f} px "
            "into "
            f"the picture, at least {LEAST_TRAVEL:g} px are needed"
        )
    last, contrast = _consistent_edge(pictures[first:], travel[first:], noise, LARGEST_SPAN * rows)
    certain = travel <= last - STRIP - 1.0  # in earlier frames the strip also contains the specimen
    certain[:first] = False
    frames, edges = [n - 1], [last]
    shift, speed = 0.0, 0.0
    for k in range(n - 2, -1, -1):
        guess = float(travel[k]) if certain[k] else shift + speed
        in_view = min(int(np.floor(last - guess)) - 1, MOST_ROWS)  # rows of the flyer, clear of its edge
        if in_view < FEWEST_ROWS:
            break
        fit = _fine_shift(pictures[k], pictures[-1], guess, in_view)
        if fit is None or abs(fit - guess) > 1.5:
            break
        speed, shift = fit - shift, fit
        frames.append(k)
        edges.append(last - shift)
    return FollowedEdge(np.array(frames), np.array(edges), contrast)


def _coarse_travel(pictures: FloatArray) -> tuple[FloatArray, int]:
    """Travel from each frame to the last one by the rows at the border [px], and the first frame in which it
    is known."""
    n, rows, _ = pictures.shape
    farthest = max(6, rows // 16)
    travel = np.zeros(n)
    for k in range(n - 2, -1, -1):
        border, next_one = pictures[k, :STRIP], pictures[k + 1]
        score = np.array(
            [
                zncc(border[max(-s, 0) :].ravel(), next_one[max(s, 0) : STRIP + s].ravel())
                for s in range(-1, farthest)
            ]
        )
        best = int(np.argmax(score))
        if score[best] < LEAST_ZNCC or travel[k + 1] > LARGEST_SPAN * rows:
            return travel, k + 1
        part = 0.0
        if 0 < best < score.size - 1:
            a, b, c = score[best - 1 : best + 2]
            part = 0.5 * (a - c) / (a - 2.0 * b + c)
        # relative to the last frame: errors do not accumulate
        rough = travel[k + 1] + best - 1 + part
        fine = _fine_shift(pictures[k], pictures[-1], rough, STRIP)
        travel[k] = rough if fine is None or abs(fine - rough) > 1.0 else fine
    return travel, 0


def _fine_shift(picture: FloatArray, last: FloatArray, guess: float, in_view: int) -> float | None:
    """Shift from the first rows of a picture to the last picture [px]; None if it does not converge."""
    f = picture[:in_view].ravel()
    f = f - f.mean()
    at = np.arange(in_view, dtype=np.float64)
    shift = guess
    for _ in range(FINE_STEPS):
        displaced = at + shift
        rows = _rows_at(last, np.concatenate([displaced, displaced - 0.5, displaced[-1:] + 0.5]))
        g, slope = rows[:in_view].ravel(), np.diff(rows[in_view:], axis=0).ravel()
        g = g - g.mean()
        gain = float(f @ g) / max(float(g @ g), 1e-12)
        slope = slope - slope.mean()
        energy = float(slope @ slope)
        if energy <= 0.0 or gain <= 0.0:
            return None
        shift += float(np.clip(slope @ (f / gain - g) / energy, -0.5, 0.5))
    return shift


def _rows_at(picture: FloatArray, at: FloatArray) -> FloatArray:
    """Interpolated rows of a picture, cubic (Catmull-Rom), shape [n, columns]."""
    rows = len(picture)
    base = np.floor(at).astype(np.int64)
    t = at - base
    outer = -0.5 * t * (1.0 - t) ** 2, 0.5 * t * t * (t - 1.0)
    inner = 1.0 + 0.5 * t * t * (3.0 * t - 5.0), 0.5 * t * (1.0 + t * (4.0 - 3.0 * t))
    take = picture[np.clip(base + np.arange(-1, 3)[:, None], 0, rows - 1)]
    return np.asarray(np.einsum("kn,knc->nc", np.stack([outer[0], *inner, outer[1]]), take))


def _row_variation(pictures: FloatArray, travel: FloatArray) -> FloatArray:
    """Standard deviation over the frames for every row of the last picture, after the shift with the
    flyer."""
    rows = pictures.shape[1]
    total = np.zeros(pictures.shape[1:])
    square, count = np.zeros_like(total), np.zeros(rows)
    for picture, offset in zip(pictures, travel, strict=True):
        at = np.arange(rows) - offset
        inside = at >= 0.0
        values = _rows_at(picture, at[inside])
        total[inside] += values
        square[inside] += values**2
        count[inside] += 1.0
    few = count < FEWEST_FRAMES
    n = np.maximum(count, 2.0)[:, None]
    variance = np.maximum(square - total**2 / n, 0.0) / (n - 1.0)
    return np.where(few, np.nan, np.sqrt(variance.mean(axis=1)))


def _consistent_edge(
    pictures: FloatArray, travel: FloatArray, noise: float, largest: float
) -> tuple[float, float]:
    """Row of the edge in the last picture, from the longest travel. Over this travel the strip shows only the
    flyer."""
    problem, before = "", 0
    for span in np.linspace(largest, LEAST_TRAVEL, SPANS):
        used = travel <= span
        if used.sum() == before:
            continue
        before = int(used.sum())
        try:
            edge, contrast = _last_edge(pictures[used], travel[used], noise)
        except ValueError as error:
            problem = str(error)
            continue
        if edge >= travel[used].max() + STRIP + 1.0:
            return edge, contrast
        problem = (
            f"about {edge:.0f} rows of it are in view, at least {STRIP + LEAST_TRAVEL + 1:.0f} are needed"
        )
    raise ValueError(f"the flyer's edge is not clear in the last usable picture: {problem}")


def rigid_limit(rows: FloatArray, noise: float) -> float:
    """Largest standard deviation over the frames for rows of the flyer, after the shift with the flyer."""
    slope = 0.5 * (rows[2:] - rows[:-2])
    true = max(float(np.mean(slope**2)) - 0.5 * noise**2, 0.0)
    return float(np.sqrt((RIGID * noise) ** 2 + PLACED**2 * true))


def _last_edge(pictures: FloatArray, travel: FloatArray, noise: float) -> tuple[float, float]:
    """Row of the edge in the last picture, and the ratio of variations across it."""
    spread = _row_variation(pictures, travel)
    finite = np.flatnonzero(np.isfinite(spread))
    if finite.size < 2 * FEWEST_ROWS:
        raise ValueError(f"{len(pictures)} frames show too little of it")
    level = float(np.median(spread[finite[:STRIP]]))
    most = rigid_limit(pictures[-1, finite[:STRIP]], noise)
    if level > most:
        raise ValueError(
            f"the rows at the border vary by {level / noise:.1f} of the noise, at most {most / noise:.1f} is "
            "rigid"
        )
    departs = finite[spread[finite] > DEPARTS * level]
    if not departs.size or departs[0] < finite[0] + FEWEST_ROWS:
        raise ValueError("no rows at the border move rigidly, or all rows do")
    first = int(departs[0])
    high = float(spread[first : first + WIDTH + 1].max())
    if high < CLEAR * level:
        raise ValueError(
            f"the rows beyond it vary by {high / level:.1f} of those before it, at least {CLEAR:g} is clear"
        )
    row = first + int(np.argmax(spread[first:] >= EDGE_SHARE * high))
    edge = row - (spread[row] - EDGE_SHARE * high) / max(spread[row] - spread[row - 1], 1e-12)
    return float(max(edge, first - 1.0)), high / level


TURNS = {"up": 0, "right": 1, "down": 2, "left": 3}
"""Number of quarter turns that rotate the flyer to the top."""
EVEN = 20.0
"""Standard deviation of the Gaussian that estimates the uneven light along a row [px]."""
CLEAR_CORRELATION = 0.5
"""The correlation across an edge is less than this share of the median within the bodies."""
APART = 0.15
"""It is also smaller by this amount than anywhere else on the same half of the specimen."""
FASTEST = 6
"""Largest motion of the flyer's edge from frame to frame [px]."""


def row_correlation(picture: FloatArray) -> FloatArray:
    """Correlation of the rows above and below each row, shape [rows]; 1 for the first and last row."""
    f = picture - gaussian_filter1d(picture, EVEN, axis=1)
    above, below = f[:-2], f[2:]
    scale = np.sqrt(np.sum(above**2, axis=1) * np.sum(below**2, axis=1))
    correlation = np.sum(above * below, axis=1) / np.where(scale > 0.0, scale, 1.0)
    return np.pad(correlation, 1, constant_values=1.0)


def rotate_rows(picture: FloatArray, toward: str) -> FloatArray:
    """The picture, rotated so that the flyer is at the top."""
    return np.rot90(picture, TURNS[toward])


def clear_edge(pairs: FloatArray, likeness: FloatArray, where: str) -> int:
    """The row before the edge, if exactly one edge among the rows is clear."""
    k = int(np.argmin(pairs))
    median = float(np.median(likeness))
    distant = np.delete(pairs, np.arange(max(k - 3, 0), min(k + 4, pairs.size)))
    second = float(distant.min(initial=1.0))
    if pairs[k] > CLEAR_CORRELATION * median or pairs[k] > second - APART:
        raise ValueError(
            f"no clear edge is seen {where}: rows that span it correlate by {pairs[k]:.2f}, others by "
            f"{second:.2f} and more; declare the regions specimen and flyer, and transmission_edge"
        )
    return k


def follow_by_correlation(
    pictures: Pictures, frames: Sequence[int], toward: str, inner: slice, start: int, farthest: int
) -> tuple[int, FloatArray, int]:
    """Track the flyer's edge along the path of least correlation from row `start` of the first frame. The
    edge must stay before row `farthest`. Returns the last frame, its picture, and the row before the edge."""
    cost, back, usable = None, [], []
    picture = np.empty(0)
    for k in frames:
        try:
            picture = rotate_rows(pictures.frame(k).astype(np.float64), toward)
        except PictureError:
            continue
        likeness = row_correlation(picture[:, inner])
        row_cost = 0.5 * (likeness[:-1] + likeness[1:])
        row_cost[farthest:] = np.inf
        if cost is None:
            cost = np.full(row_cost.size, np.inf)
            cost[start] = row_cost[start]
        else:
            steps = np.stack([_shifted(cost, step) for step in range(-1, FASTEST + 1)])
            back.append(np.argmin(steps, axis=0) - 1)
            cost = row_cost + steps.min(axis=0)
        usable.append((k, row_cost, float(np.median(likeness[:farthest]))))
    assert cost is not None  # at least one static frame is usable
    row = int(np.argmin(cost))
    last, row_cost, median = usable[-1]
    if row_cost[row] > CLEAR_CORRELATION * median:
        raise ValueError(
            f"the flyer's edge is lost on the way to frame {last}: rows that span it correlate by "
            f"{row_cost[row]:.2f}, others by {median:.2f}; declare flyer, in a frame that shows much of it"
        )
    return last, picture, row


def _shifted(cost: FloatArray, step: int) -> FloatArray:
    """The cost, shifted by `step` rows."""
    result = np.full(cost.size, np.inf)
    if step >= 0:
        result[step:] = cost[: cost.size - step]
    else:
        result[:step] = cost[-step:]
    return result


BLOCKS = 8
"""Number of blocks of columns."""
NARROWEST = 8
"""Smallest number of columns of a block [px]."""
RIM_CLEARANCE = 4
"""Rows between the approximate edge and the rows that certainly show the platen [px]."""
FEWEST = 3
"""Smallest number of rows of the platen for an estimate of its grey level."""
SHARE = 0.5
"""The edge is where the difference from the platen's grey level is this share of the difference in the
specimen's rows."""
SPREAD = 0.4
"""The weight of a block decreases if its edge is farther from the arc than this [px]."""


def end_arc(picture: FloatArray, edge: float) -> FloatArray | None:
    """Row of a specimen's end in every column.

    ``picture``: mean picture at rest, the specimen above a bare platen, without its flanks, shape [rows,
    columns]. ``edge``: row at which the specimen ends in the mean of the columns [px]. Returns: shape
    [columns]; None where too little of the platen is in view, or too few columns.
    """
    rows, columns = picture.shape
    platen = int(np.ceil(edge)) + RIM_CLEARANCE
    if rows - platen < FEWEST or columns < BLOCKS * NARROWEST or platen - 3 * RIM_CLEARANCE < FEWEST:
        return None
    middles, edges = [], []
    for block in np.array_split(np.arange(columns), BLOCKS):
        middles.append(float(block.mean()))
        edges.append(block_edge(picture[:, block], platen))
    x, y = 2.0 * np.array(middles) / columns - 1.0, np.array(edges)
    basis = np.stack([np.ones(BLOCKS), x, x**2], axis=1)
    start = np.array([float(np.median(y)), 0.0, 0.0])
    fit = least_squares(lambda p: basis @ p - y, start, loss="soft_l1", f_scale=SPREAD)
    at = 2.0 * np.arange(columns) / columns - 1.0
    return np.asarray(np.stack([np.ones(columns), at, at**2], axis=1) @ fit.x)


def block_edge(block: FloatArray, platen: int) -> float:
    """Row at which a block of columns falls to the platen's grey level [px]. It lies between the last row of
    the specimen and the next one.
    """
    level = np.median(block[platen:])
    departs = np.sqrt(np.mean((block - level) ** 2, axis=1))
    limit = SHARE * float(np.median(departs[: platen - 2 * RIM_CLEARANCE]))
    last = int(np.flatnonzero(departs[:platen] >= limit)[-1])
    if last + 1 >= len(departs) or departs[last] <= departs[last + 1]:
        return float(last)
    return last + float((departs[last] - limit) / (departs[last] - departs[last + 1]))
