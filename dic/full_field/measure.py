"""Full-field measurement of a plane by one camera. Settings, extensometers and grey noise of all full
fields."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import BoolArray, FloatArray, IntArray, check_fields, check_shape
from dic.bodies.region import grid_points
from dic.correlation import Correlation, Noise
from dic.correlation.subsets import Shape, apply, overlap_correlation
from dic.images import PictureError, Pictures, check_series, frame_health
from dic.images.quality import grey_noise
from dic.images.series import PicturesInMemory, decode_once
from dic.outcome import FrameOutcome, PointOutcome
from dic.result import Extension, FullField, SurfaceStrain
from dic.surfaces.strains import StrainGauge, StrainOutcome, strains
from dic.surfaces.surface_history import SurfaceHistory
from dic.tracking import Track, Tracking, track


@dataclass(frozen=True, kw_only=True)
class FullFieldSettings:
    """Settings of a full-field measurement.

    Raises
    ------
    ValueError
        If a value is outside its range; the message names it.
    """

    step: int = 5
    """Distance of adjacent points [px]."""
    margin: float = 2.0
    """Smallest distance of a point from the boundary of the mask [px]."""
    tracking: Tracking = field(default_factory=Tracking)
    """Settings of the tracking in time; its subset is used throughout the measurement."""
    stereo_shape: Shape = Shape.QUADRATIC
    """Shape function of the match between two cameras."""
    strain_window: int = 5
    """Side of the window of points for a strain fit, odd."""
    strain_order: int = 1
    """Order of the polynomial in that window, 1 or 2."""
    reference: int = 0
    """Reference frame: its points are chosen there, and displacements are relative to it."""
    static: int = 1
    """Number of static frames at the beginning. From two or more, the noise of the grey values and a mean
    reference position are computed."""
    noise: float | None = None
    """Standard deviation of a grey value [grey]. None: it is estimated from the static frames. With only one
    static frame it is estimated from the residuals of the matches."""
    device: str = "cpu"

    @property
    def subset(self) -> int:
        """Side of the subsets [px]."""
        return self.tracking.correlation.subset

    @property
    def stereo(self) -> Correlation:
        """Settings of the match between two cameras."""
        return replace(self.tracking.correlation, shape=self.stereo_shape)

    @property
    def gauge(self) -> float:
        """Side of the virtual strain gauge [px]: (window - 1) step + subset."""
        return float((self.strain_window - 1) * self.step + self.subset)

    def __post_init__(self) -> None:
        check_fields(
            self,
            step=(self.step >= 1, "at least 1 px"),
            margin=(0.0 <= self.margin < np.inf, "not negative"),
            strain_window=(self.strain_window >= 3 and self.strain_window % 2 == 1, "odd, at least 3"),
            strain_order=(self.strain_order in (1, 2), "1 or 2"),
            reference=(self.reference >= 0, "a frame number from 0"),
            static=(self.static >= 1, "at least 1 frame"),
            noise=(self.noise is None or self.noise > 0.0, "positive, or None"),
            stereo_shape=(self.stereo_shape >= Shape.AFFINE, "AFFINE or QUADRATIC"),
        )


FEWEST = 4
"""Smallest number of valid points around an end."""
THINNEST = 0.3
"""Smallest spread of these points in any direction [steps, root mean square]."""


@dataclass(frozen=True)
class Extensometer:
    """A virtual extensometer."""

    name: str
    ends: tuple[tuple[float, float], tuple[float, float]]
    """Its ends in the reference picture of camera 0 (x, y) [px]."""
    window: int = 3
    """Side of the square of points that determine the position of an end [points], odd."""

    def __post_init__(self) -> None:
        if not (self.window >= 3 and self.window % 2 == 1):
            raise ValueError(f"window must be odd and at least 3 points, got {self.window}")
        check_shape((2, 2), **{f"ends of the extensometer {self.name}": self.ends})
        if self.ends[0] == self.ends[1]:
            raise ValueError(f"the ends of the extensometer {self.name} are one place: {self.ends[0]} px")


def extension(
    surface: SurfaceHistory,
    points: FloatArray,
    extensometer: Extensometer,
    *,
    step: float,
    subset: float,
    reference_sigma: FloatArray | None = None,
) -> Extension:
    """Length of an extensometer in every frame.

    A plane is fitted to the positions of the points around an end; its value at the end is the position. The
    same points and weights w are used at the reference, so lost points do not shift an end. The sigma is that
    of ``n · Σ g x``. g is w of the second end minus w of the first; n is the unit vector between the ends.
    The errors of points are correlated where their subsets overlap.

    ``points``: positions of its points in the reference picture [px], shape [n_points, 2]. ``step``,
    ``subset``: distance of adjacent points, and side of the subsets [px]. ``reference_sigma``: standard
    deviations of the reference positions [m], shape [n_points, 3]. They are independent of those of the
    frames. None: the positions are exact.
    """
    near = [_near(points, end, extensometer.window, step) for end in extensometer.ends]
    rows = np.flatnonzero(near[0] | near[1])
    grid, valid = points[rows], surface.valid[:, rows]
    rho = overlap_correlation(grid, grid, subset)
    start_sigma = np.zeros((rows.size, 3)) if reference_sigma is None else reference_sigma[rows]
    n_frames = surface.n_frames
    length, elongation, sigma = (np.full(n_frames, np.nan) for _ in range(3))
    strain, outcome = np.full(n_frames, np.nan), np.full(n_frames, int(StrainOutcome.TOO_FEW_NEIGHBOURS))
    for k in range(n_frames):
        weights = [
            _weights(grid, valid[k] & inside[rows], end, step)
            for inside, end in zip(near, extensometer.ends, strict=True)
        ]
        if weights[0] is None or weights[1] is None:
            continue
        g = weights[1] - weights[0]
        position = np.where(valid[k, :, None], surface.position[k, rows], 0.0)
        between, before = g @ position, g @ surface.X[rows]
        length[k], initial = np.linalg.norm(between), np.linalg.norm(before)
        elongation[k] = length[k] - initial
        strain[k] = elongation[k] / initial
        noise = np.where(valid[k, :, None], surface.sigma[k, rows], 0.0)
        n, n0 = between / length[k], before / initial
        errors = g[:, None] * np.hstack([n * noise, n0 * start_sigma])  # one column for each component
        sigma[k] = np.sqrt(np.einsum("ic,ij,jc->", errors, rho, errors))
        outcome[k] = int(StrainOutcome.VALID)
    return Extension(
        extensometer.name, np.array(extensometer.ends), length, elongation, sigma, strain, outcome
    )


def extensions(
    surface: SurfaceHistory, points: FloatArray, gauges: Sequence[Extensometer], **settings: object
) -> tuple[Extension, ...]:
    """`extension` of several extensometers.

    Raises ValueError if an end lies outside all points: no frame could give a length.
    """
    for one in gauges:
        for end in one.ends:
            if _near(points, end, one.window, float(settings["step"])).sum() < FEWEST:  # type: ignore[arg-type]
                raise ValueError(
                    f"the end ({end[0]:g}, {end[1]:g}) px of the extensometer {one.name} has fewer than "
                    f"{FEWEST} points around it: place it on the region, or enlarge its window"
                )
    return tuple(extension(surface, points, one, **settings) for one in gauges)  # type: ignore[arg-type]


def _near(points: FloatArray, end: tuple[float, float], window: int, step: float) -> BoolArray:
    """Points in the window around an end, shape [n_points]."""
    return np.asarray((np.abs(points - np.array(end)) <= 0.5 * window * step + 1e-9).all(axis=1))


def _weights(grid: FloatArray, used: BoolArray, end: tuple[float, float], step: float) -> FloatArray | None:
    """Weights of the used points for the value of their best-fit plane at `end`, shape [n]. None if there are
    too few points or they lie nearly on a line."""
    if used.sum() < FEWEST:
        return None
    q = (grid[used] - np.array(end)) / step
    if np.linalg.eigvalsh(np.cov(q.T, bias=True))[0] < THINNEST**2:
        return None
    T = np.column_stack([np.ones(len(q)), q])
    weights = np.zeros(len(grid))
    weights[used] = np.linalg.solve(T.T @ T, T.T)[0]
    return weights


def noise_at_rest(
    pictures: Pictures, health: IntArray, static: int, mask: BoolArray | None
) -> tuple[Noise, float] | None:
    """Noise from the static frames, and its standard deviation [grey]; None if fewer than two are usable.

    ``health``: `FrameOutcome` of its pictures, shape [n_frames]. ``static``: number of static frames at the
    beginning. ``mask``: pixels that are used, shape [rows, columns]; None: all.
    """
    rest_frames = np.flatnonzero(health[:static] == FrameOutcome.VALID)
    if rest_frames.size < 2:
        return None
    try:
        grey = grey_noise(pictures, rest_frames.tolist(), mask=mask)
    except (PictureError, ValueError):
        return None
    line = grey.intercept > 0.0 and grey.slope > 0.0
    noise = Noise(floor=grey.intercept**0.5, gain=grey.slope) if line else Noise(floor=grey.sigma)
    return noise, grey.sigma


def noise_from_matches(
    picture: NDArray[np.generic], points: FloatArray, zncc: FloatArray, subset: int
) -> float:
    """Standard deviation of a grey value, estimated from the correlation of the matched subsets [grey].

    Two pictures of one pattern with independent noise σ have the correlation ``1 - σ²/s²``. s² is the
    variance of the grey values in the subset, including noise. The result is the median over the points of
    ``s √(1 - zncc)``. It includes errors of interpolation and shape function and tends to be too large.

    ``picture``: the reference picture, shape [rows, columns]. ``points``: centres of the matched subsets
    [px], shape [n, 2]. ``zncc``: their correlations, shape [n]. ``subset``: side of the subsets [px].
    """
    if not len(points):
        raise ValueError("no subset was matched, so the noise of the grey values is not known: declare it")
    from dic.basics import cv2

    grey = np.asarray(picture, dtype=np.float64)
    size = (subset, subset)
    mean = cv2.boxFilter(grey, -1, size)
    variance = cv2.boxFilter(grey * grey, -1, size) - mean * mean
    column, row = np.round(points).astype(np.int64).T
    s2 = np.maximum(variance[row, column], 0.0)
    return float(np.sqrt(np.median(s2 * np.maximum(1.0 - zncc, 0.0))))


Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``."""
Series = Pictures | Sequence[Any]
"""A series of pictures, or arrays [rows, columns] in memory."""
EXACT = 1e-4
"""Standard deviation of a chosen position [px]: a chosen position is exact."""


def measure_plane(
    pictures: Series,
    settings: FullFieldSettings | None = None,
    *,
    mask: BoolArray | None = None,
    t: FloatArray | None = None,
    scale: float | None = None,
    extensometers: Sequence[Extensometer] = (),
    facts: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> FullField:
    """Measure displacements and strains of a plane surface by one camera perpendicular to it.

    Parameters
    ----------
    pictures
        The series.
    settings
        Settings; None: `FullFieldSettings()`.
    mask
        Pixels of the surface in the reference picture, shape [rows, columns]; None: the whole picture.
    t
        Frame times [s], shape [n_frames]; None: those of the series, or the numbers of the frames.
    scale
        Length on the surface that one pixel shows [m]; None: lengths are in px.
    extensometers
        Virtual extensometers.
    facts
        Further facts, stored in the result.
    progress
        Called as ``progress(stage, done, total)`` with the frames done.

    Returns
    -------
    FullField
        The result, x to the right, y down. Points and frames that failed are kept, with an outcome.

    Raises
    ------
    ValueError
        If shapes do not match, the reference picture is unusable, no point lies in the mask, or an
        extensometer lies outside all points.

    Examples
    --------
    >>> import numpy as np
    >>> from dic import measure_plane
    >>> from scipy.ndimage import gaussian_filter
    >>> speckles = gaussian_filter(np.random.default_rng(1).random((80, 80)), 1.5)
    >>> field = measure_plane([speckles, np.roll(speckles, 1, axis=1)])
    >>> bool(abs(np.nanmedian(field.surface.u[1, :, 0]) - 1.0) < 0.01)  # one pixel to the right
    True
    """
    chosen = settings or FullFieldSettings()
    series = as_series(pictures)
    found = frame_health(series)
    check_series(series, found)
    health = found.outcome
    usable_reference([health], chosen)
    time, timed = times_of(series, t)
    mask = full_mask(mask, series)
    points, cell = grid_points(mask, chosen.step, margin=chosen.margin)
    rest_noise = known_noise(series, health, mask, chosen)
    tracked = track(
        series,
        points,
        chosen.tracking,
        noise=Noise(1.0) if rest_noise is None else rest_noise[0],
        mask=mask,
        first=chosen.reference,
        frame_outcome=health,
        device=chosen.device,
        progress=None if progress is None else lambda done, total: progress("camera 0", done, total),
    )
    if rest_noise is None:
        sigma = _noise_in(tracked, series, chosen)
        tracked = replace(tracked, covariance=tracked.covariance * sigma**2)
    else:
        sigma = rest_noise[1]
    unit = 1.0 if scale is None else scale
    surface = _plane(tracked, time, unit, chosen.reference)
    strain = strains_of(surface, points, chosen)
    return FullField(
        kind="plane",
        unit="px" if scale is None else "m",
        timed=timed,
        frame_outcome=frame_outcomes([health], surface),
        surface=surface,
        strain=strain,
        points=points,
        cell=cell,
        pixels=places(tracked)[None],
        zncc=np.where(np.isfinite(tracked.zncc), tracked.zncc, np.nan)[None],
        epipolar=np.full(tracked.outcome.shape, np.nan),
        noise=np.array([sigma]),
        extensions=extensions(surface, points, extensometers, step=chosen.step, subset=chosen.subset),
        facts={**(facts or {}), **facts_of(chosen, [series], rest_noise is not None)},
    )


def as_series(pictures: Series) -> Pictures:
    """A series whose pictures are read only once; made from arrays if these are given."""
    return decode_once(pictures if isinstance(pictures, Pictures) else PicturesInMemory(pictures))


def full_mask(mask: BoolArray | None, series: Pictures) -> BoolArray:
    """The mask, or one of the whole picture; ValueError if its size differs from that of the pictures."""
    if mask is None:
        return np.ones(series.shape, dtype=bool)
    if np.shape(mask) != series.shape:
        raise ValueError(f"the mask is {np.shape(mask)}, the pictures are {series.shape} (rows, columns)")
    return np.asarray(mask, dtype=bool)


def times_of(series: Pictures, t: FloatArray | None) -> tuple[FloatArray, bool]:
    """Frame times [s] and True, or the frame numbers and False if no times are known."""
    times = series.times if t is None else t
    if times is None:
        return np.arange(series.n_frames, dtype=np.float64), False
    if np.shape(times) != (series.n_frames,):
        raise ValueError(f"t has shape {np.shape(times)}, there are {series.n_frames} pictures")
    return np.asarray(times, dtype=np.float64), True


def usable_reference(health: Sequence[IntArray], settings: FullFieldSettings) -> None:
    """Raise ValueError if the reference frame does not exist or has no usable picture."""
    for camera, outcome in enumerate(health):
        if settings.reference >= outcome.size:
            raise ValueError(f"reference is frame {settings.reference}, there are {outcome.size} frames")
        frame_outcome = FrameOutcome(int(outcome[settings.reference]))
        if not frame_outcome.ok:
            raise ValueError(
                f"camera {camera}'s picture of the reference frame {settings.reference} cannot be used: "
                f"{frame_outcome.cause}; choose another reference"
            )


def known_noise(
    series: Pictures, health: IntArray, mask: BoolArray | None, settings: FullFieldSettings
) -> tuple[Noise, float] | None:
    """The declared noise, or that of the static frames; None if there is neither."""
    if settings.noise is not None:
        return Noise(floor=settings.noise), settings.noise
    return noise_at_rest(series, health, settings.static, mask)


def _noise_in(tracked: Track, series: Pictures, settings: FullFieldSettings) -> float:
    """Noise of the grey values from the first frame with tracked points [grey]."""
    counts = (tracked.outcome == PointOutcome.VALID).sum(axis=1)
    counts[settings.reference] = 0  # a picture correlates with itself, including its noise
    frames = np.flatnonzero(counts >= max(1, counts.max() // 2))
    if not counts.any():
        raise ValueError(
            "no point was followed into another frame, though the pictures are usable. Likely causes: the "
            "motion from frame to frame is larger than the search, the region misses the pattern, or "
            "the subset is smaller than the speckles. Correct region or subset, or take a later reference"
        )
    frame = int(frames[np.argmin(np.abs(frames - settings.reference))])
    valid = tracked.outcome[frame] == PointOutcome.VALID
    picture = series.frame(settings.reference)
    return noise_from_matches(picture, tracked.points[valid], tracked.zncc[frame, valid], settings.subset)


def places(tracked: Track) -> FloatArray:
    """Positions of a track's points [px], NaN where lost, shape [n_frames, n_points, 2]."""
    valid = (tracked.outcome == PointOutcome.VALID)[..., None]
    return np.where(valid, apply(tracked.points, tracked.warp), np.nan)


def strains_of(
    surface: SurfaceHistory,
    points: FloatArray,
    settings: FullFieldSettings,
    reference_sigma: FloatArray | None = None,
) -> SurfaceStrain:
    """Green-Lagrange strains over the declared window."""
    gauge = StrainGauge(settings.strain_window, settings.step, settings.subset, order=settings.strain_order)
    history = strains(surface, points, gauge, reference_sigma=reference_sigma)
    strain = history.green_lagrange
    return SurfaceStrain(value=strain.value, sigma=strain.sigma, outcome=history.outcome, gauge=history.gauge)


def frame_outcomes(health: Sequence[IntArray], surface: SurfaceHistory) -> IntArray:
    """Outcome of each frame: that of its pictures, or LOST if no point was found."""
    outcome = np.asarray(health[0])
    for camera_outcome in health[1:]:
        outcome = np.where(outcome != FrameOutcome.VALID, outcome, camera_outcome)
    empty = (outcome == FrameOutcome.VALID) & ~surface.valid.any(axis=1)
    return np.asarray(np.where(empty, int(FrameOutcome.LOST), outcome), dtype=np.int64)


def facts_of(settings: FullFieldSettings, series: Sequence[Pictures], measured: bool) -> dict[str, Any]:
    """Facts on settings and pictures, in JSON types."""
    rows, columns = series[0].shape
    subset = settings.tracking.correlation
    if settings.noise is not None:
        origin = "declared"
    else:
        origin = "static frames" if measured else "residuals of the matches"
    return {
        "subset": settings.subset,
        "step": settings.step,
        "shape": subset.shape.name.lower(),
        "prefilter": subset.prefilter,
        "strain_window": settings.strain_window,
        "strain_order": settings.strain_order,
        "strain_gauge": settings.gauge,
        "reference": settings.reference,
        "static": settings.static,
        "noise_from": origin,
        "picture_size": [columns, rows],
        "frames": series[0].n_frames,
    }


def _plane(tracked: Track, t: FloatArray, unit: float, reference: int) -> SurfaceHistory:
    """A track as a surface in the plane Z = 0."""
    valid = tracked.outcome == PointOutcome.VALID
    u = np.zeros((*valid.shape, 3))
    u[..., :2] = unit * tracked.warp[..., :2]
    sigma = np.full((*valid.shape, 3), unit * EXACT)
    variance = np.einsum("...ii->...i", tracked.covariance)
    sigma[..., :2] = unit * np.sqrt(np.where(valid[..., None], variance, np.nan) + EXACT**2)
    X = np.column_stack([unit * tracked.points, np.zeros(len(tracked.points))])
    invalid = ~valid[..., None]
    u[reference, valid[reference]] = 0.0
    return SurfaceHistory(
        t=t,
        X=X,
        u=np.where(invalid, np.nan, u),
        sigma=np.where(invalid, np.nan, sigma),
        outcome=tracked.outcome,
    )
