"""Full-field measurement from pictures to a result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.region import grid_points
from dic.correlation import Noise
from dic.correlation.warp import apply
from dic.full_field.extensometers import Extensometer, extensions
from dic.full_field.grey_noise import noise_at_rest, noise_from_matches
from dic.full_field.result import FullField
from dic.full_field.settings import FullFieldSettings
from dic.images import Pictures, frame_health
from dic.images.kept import kept
from dic.images.memory import PicturesInMemory
from dic.outcome import FrameOutcome, PointOutcome
from dic.result import SurfaceStrain
from dic.surfaces.strains import StrainGauge, strains
from dic.surfaces.surface_history import SurfaceHistory
from dic.tracking import Track, track

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``."""
Series = Pictures | Sequence[Any]
"""A series of pictures, or arrays [rows, columns] in memory."""
EXACT = 1e-4
"""Standard deviation of a place that was chosen [px]."""


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
    """Measure displacements and strains of a plane surface by one camera that looks straight at it.

    Parameters
    ----------
    pictures
        The series.
    settings
        How to measure; None: `FullFieldSettings()`.
    mask
        Pixels of the surface in the reference picture, shape [rows, columns]; None: the whole picture.
    t
        Frame times [s], shape [n_frames]; None: those of the series, or the numbers of the frames.
    scale
        Length of a pixel on the surface [m]; None: lengths are in px.
    extensometers
        Virtual extensometers.
    facts
        What else is known, kept in the result.
    progress
        Told of the frames done.

    Returns
    -------
    FullField
        x to the right, y down. A point or frame that failed has an outcome in it.

    Raises
    ------
    ValueError
        Shapes that do not fit, a reference picture that cannot be used, no point in the mask, an extensometer
        beside all points.
    """
    chosen = settings or FullFieldSettings()
    series = as_series(pictures)
    health = frame_health(series).outcome
    usable_reference([health], chosen)
    time, timed = times_of(series, t)
    mask = whole(mask, series)
    points, cell = grid_points(mask, chosen.step, margin=chosen.margin)
    known = known_noise(series, health, mask, chosen)
    found = track(
        series,
        points,
        chosen.tracking,
        noise=Noise(1.0) if known is None else known[0],
        mask=mask,
        first=chosen.reference,
        frame_outcome=health,
        device=chosen.device,
        progress=None if progress is None else lambda done, total: progress("camera 0", done, total),
    )
    if known is None:
        sigma = noise_in(found, series, chosen)
        found = replace(found, covariance=found.covariance * sigma**2)
    else:
        sigma = known[1]
    unit = 1.0 if scale is None else scale
    surface = _plane(found, time, unit, chosen.reference)
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
        pixels=places(found)[None],
        zncc=np.where(np.isfinite(found.zncc), found.zncc, np.nan)[None],
        epipolar=np.full(found.outcome.shape, np.nan),
        noise=np.array([sigma]),
        extensions=extensions(surface, points, extensometers, step=chosen.step, subset=chosen.subset),
        facts={**(facts or {}), **facts_of(chosen, [series], known is not None)},
    )


def as_series(pictures: Series) -> Pictures:
    """A series whose pictures are read once; arrays become one."""
    return kept(pictures if isinstance(pictures, Pictures) else PicturesInMemory(pictures))


def whole(mask: BoolArray | None, series: Pictures) -> BoolArray:
    """The mask, or that of the whole picture; a ValueError if it is of another size."""
    if mask is None:
        return np.ones(series.shape, dtype=bool)
    if np.shape(mask) != series.shape:
        raise ValueError(f"the mask is {np.shape(mask)}, the pictures are {series.shape} (rows, columns)")
    return np.asarray(mask, dtype=bool)


def times_of(series: Pictures, t: FloatArray | None) -> tuple[FloatArray, bool]:
    """Frame times, and whether a clock gave them; else the numbers of the frames."""
    given = series.times if t is None else t
    if given is None:
        return np.arange(series.n_frames, dtype=np.float64), False
    if np.shape(given) != (series.n_frames,):
        raise ValueError(f"t has shape {np.shape(given)}, there are {series.n_frames} pictures")
    return np.asarray(given, dtype=np.float64), True


def usable_reference(health: Sequence[IntArray], settings: FullFieldSettings) -> None:
    """Refuse a reference frame that is not there or has no usable picture."""
    for camera, outcome in enumerate(health):
        if settings.reference >= outcome.size:
            raise ValueError(f"reference is frame {settings.reference}, there are {outcome.size} frames")
        found = FrameOutcome(int(outcome[settings.reference]))
        if not found.ok:
            raise ValueError(
                f"camera {camera}'s picture of the reference frame {settings.reference} cannot be used: "
                f"{found.cause}; choose another reference"
            )


def known_noise(
    series: Pictures, health: IntArray, mask: BoolArray | None, settings: FullFieldSettings
) -> tuple[Noise, float] | None:
    """The noise that was declared, or that of the static frames; None if neither is there."""
    if settings.noise is not None:
        return Noise(floor=settings.noise), settings.noise
    return noise_at_rest(series, health, settings.static, mask)


def noise_in(found: Track, series: Pictures, settings: FullFieldSettings) -> float:
    """Noise of the grey values from the first frame that the points were followed into [grey]."""
    counts = (found.outcome == PointOutcome.VALID).sum(axis=1)
    counts[settings.reference] = 0  # a picture correlates with itself, noise and all
    frames = np.flatnonzero(counts >= max(1, counts.max() // 2))
    if not counts.any():
        raise ValueError(
            "no point was followed into another frame: check region, subset and the size of the motion, or "
            "declare the noise of the grey values"
        )
    frame = int(frames[np.argmin(np.abs(frames - settings.reference))])
    valid = found.outcome[frame] == PointOutcome.VALID
    picture = series.frame(settings.reference)
    return noise_from_matches(picture, found.points[valid], found.zncc[frame, valid], settings.subset)


def places(found: Track) -> FloatArray:
    """Places of a track's points [px], NaN where lost, shape [n_frames, n_points, 2]."""
    valid = (found.outcome == PointOutcome.VALID)[..., None]
    return np.where(valid, apply(found.points, found.warp), np.nan)


def strains_of(
    surface: SurfaceHistory,
    points: FloatArray,
    settings: FullFieldSettings,
    reference_sigma: FloatArray | None = None,
) -> SurfaceStrain:
    """Green-Lagrange strains over the declared window."""
    gauge = StrainGauge(
        window=settings.strain_window,
        step=settings.step,
        subset=settings.subset,
        order=settings.strain_order,
    )
    history = strains(surface, points, gauge, reference_sigma=reference_sigma)
    found = history.green_lagrange
    return SurfaceStrain(value=found.value, sigma=found.sigma, outcome=history.outcome, gauge=history.gauge)


def frame_outcomes(health: Sequence[IntArray], surface: SurfaceHistory) -> IntArray:
    """Outcome of each frame: that of its pictures, LOST where no point was found."""
    outcome = np.asarray(health[0])
    for other in health[1:]:
        outcome = np.where(outcome != FrameOutcome.VALID, outcome, other)
    lost = (outcome == FrameOutcome.VALID) & ~surface.valid.any(axis=1)
    return np.asarray(np.where(lost, int(FrameOutcome.LOST), outcome), dtype=np.int64)


def facts_of(settings: FullFieldSettings, series: Sequence[Pictures], measured: bool) -> dict[str, Any]:
    """Settings and pictures as JSON can hold them."""
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


def _plane(found: Track, t: FloatArray, unit: float, reference: int) -> SurfaceHistory:
    """A track as a surface: the plane Z = 0."""
    valid = found.outcome == PointOutcome.VALID
    u = np.zeros((*valid.shape, 3))
    u[..., :2] = unit * found.warp[..., :2]
    sigma = np.full((*valid.shape, 3), unit * EXACT)
    variance = np.einsum("...ii->...i", found.covariance)
    sigma[..., :2] = unit * np.sqrt(np.where(valid[..., None], variance, np.nan) + EXACT**2)
    X = np.column_stack([unit * found.points, np.zeros(len(found.points))])
    gone = ~valid[..., None]
    u[reference, valid[reference]] = 0.0
    return SurfaceHistory(
        t=t, X=X, u=np.where(gone, np.nan, u), sigma=np.where(gone, np.nan, sigma), outcome=found.outcome
    )
