"""Speckle report of a measurement, camera by camera: predicted noise floor, and where the subset is too
small."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from dic.arrays import FloatArray
from dic.bodies.region import polygon_mask
from dic.images import GreyNoise, Pictures, SpeckleQuality, grey_noise, speckle_quality
from dic.result import StereoResult

WANTED = 0.02
"""Predicted standard deviation of a match above which a subset is called too small [px]."""
MOST_AVERAGED = 50
"""Static pictures that are averaged."""


@dataclass(frozen=True)
class Speckles:
    """The speckles of one camera."""

    picture: FloatArray
    """Mean of the static pictures [grey], shape [rows, columns]."""
    quality: SpeckleQuality
    """Their quality."""


def speckles(
    pictures: Pictures,
    frames: Sequence[int],
    noise: GreyNoise,
    pixels: FloatArray,
    *,
    subset: int,
    wanted: float = WANTED,
) -> Speckles:
    """Judge the speckles between the points that a camera sees of a body at rest.

    Parameters
    ----------
    pictures
        The camera's series.
    frames
        Static frames with a usable picture.
    noise
        Of its grey values.
    pixels
        Where it sees the body's points at rest [px], shape [n, 2]; NaN where it does not. Their convex hull
        is what is judged.
    subset
        Side of the subsets [px].
    wanted
        Predicted standard deviation that a subset should reach [px].

    Raises
    ------
    ValueError
        Fewer than three points, not on one line, or no contrast between them.
    """
    chosen = list(frames)[:MOST_AVERAGED]
    seen = pixels[np.isfinite(pixels).all(axis=1)]
    if len(seen) < 3 or np.linalg.matrix_rank(seen - seen[0]) < 2:
        raise ValueError(f"{len(seen)} points span no area whose speckles could be judged")
    corners = seen[ConvexHull(seen).vertices]
    total = np.zeros(pictures.shape)
    for frame in chosen:
        total += pictures.frame(frame)
    mean = total / len(chosen)
    mask = polygon_mask([(float(x), float(y)) for x, y in corners], pictures.shape)
    return Speckles(mean, speckle_quality(mean, mask, subset, noise, averaged=len(chosen), wanted=wanted))


def facts(quality: SpeckleQuality) -> dict[str, Any]:
    """Facts of the speckles for the reporting table, as JSON can hold them: lengths in px, gradients in
    grey/px."""
    judged = ~np.any(np.isnan(quality.floor), axis=2)
    worst = quality.floor[judged].max(axis=1)
    needed = np.zeros(0) if quality.needed is None else quality.needed[judged]
    return {
        "size": list(quality.size),
        "size_by_edges": quality.size_by_edges,
        "coverage": quality.coverage,
        "mean_gradient": quality.mean_gradient,
        "noise": quality.noise,
        "floor": quality.median_floor if worst.size else None,
        "wanted": quality.wanted,
        "too_small": float(quality.too_small[judged].mean()) if worst.size else None,
        # the subset that nearly all places would do with; none if some would do with none that was tried
        "needed": int(np.percentile(needed, 95)) if needed.size and np.mean(needed > 0) > 0.95 else None,
    }


def speckles_of(
    result: StereoResult, pictures: tuple[Pictures, Pictures]
) -> tuple[Speckles | None, Speckles | None]:
    """The speckles of both cameras of a stereo result; None where they cannot be judged.

    Parameters
    ----------
    result
        What the pictures gave; its table says why a camera's speckles cannot be judged.
    pictures
        The series it was made from.
    """
    found: list[Speckles | None] = []
    rest = np.flatnonzero(result.static & result.specimen.surface.valid.any(axis=1)).tolist()
    inputs = result.facts.get("speckle") or [{"problem": "not asked for"}] * len(pictures)
    for series, pixels, fact in zip(pictures, result.specimen.pixels, inputs, strict=True):
        if "problem" in fact:
            found.append(None)
            continue
        noise = grey_noise(series, rest)
        subset = result.facts["settings"]["subset"]
        found.append(speckles(series, rest, noise, pixels[rest[0]], subset=subset, wanted=fact["wanted"]))
    return found[0], found[1]
