"""Pictures for the figures of a stereo or a full-field result.

A few whole pictures, and one column of all.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dic.chain.remarks import Speckles, speckles_of
from dic.images import PictureError, Pictures
from dic.outcome import PointOutcome
from dic.result import FullField, StereoResult
from kolsky.bars.flyer.flight import FlightOfSpecimen
from kolsky.base.arrays import FloatArray

OUTCOME_COLOURS = {
    PointOutcome.VALID: "#0072b2",
    PointOutcome.OUT_OF_VIEW: "#56b4e9",
    PointOutcome.LOW_CONTRAST: "#f0e442",
    PointOutcome.NOT_CONVERGED: "#e69f00",
    PointOutcome.LOW_CORRELATION: "#d55e00",
    PointOutcome.STEREO_MISMATCH: "#cc79a7",
    PointOutcome.NO_FIRST_GUESS: "#7f5539",
    PointOutcome.NO_PICTURE: "#000000",
    PointOutcome.AT_END: "#bdbdbd",
    PointOutcome.OFF_SURFACE: "#7a1fa2",
}
"""A colour for every outcome."""
SHOWN_PICTURES = 4
"""Number of pictures shown."""


@dataclass(frozen=True)
class SurfaceView:
    """A stereo result with pictures of camera 0."""

    shot: str
    result: StereoResult
    pictures: Mapping[int, NDArray[np.generic]]
    """Some pictures of camera 0 by frame, each of shape [rows, columns]."""
    kymograph: FloatArray
    """Column of the outline (x = 0) in every picture of camera 0, [rows, n_frames]; NaN if unreadable."""
    flight: FlightOfSpecimen | str = "not asked for"
    """Flight of the flyer, or the reason why it could not be computed."""
    speckles: tuple[Speckles | None, Speckles | None] = (None, None)
    """Speckles of both cameras in the static pictures; None if they cannot be evaluated."""


def read_surface_view(
    shot: str,
    result: StereoResult,
    pictures: tuple[Pictures, Pictures],
    flight: FlightOfSpecimen | str = "not asked for",
) -> SurfaceView:
    """Read the pictures of camera 0 for the figures and evaluate the speckles of both cameras."""
    chosen, first = set(_shown_frames(result)), pictures[0]
    body = result.specimen
    nearest = np.argsort(np.abs(body.surface.X[:, 0]))[: max(3, body.surface.n_points // 20)]
    column = int(np.clip(np.round(np.median(body.points[nearest, 0])), 0, first.shape[1] - 1))
    kymograph = np.full((first.shape[0], first.n_frames), np.nan)
    kept = {}
    for frame in range(first.n_frames):
        try:
            picture = first.frame(frame)
        except PictureError:
            continue
        kymograph[:, frame] = picture[:, column]
        if frame in chosen:
            kept[frame] = np.array(picture)
    return SurfaceView(
        shot=shot,
        result=result,
        pictures=kept,
        kymograph=kymograph,
        flight=flight,
        speckles=speckles_of(result, pictures),
    )


def _shown_frames(result: StereoResult) -> list[int]:
    """Return frames at equal intervals among those with points: first, last and two between."""
    usable = np.flatnonzero(result.specimen.n_valid > 0)
    if usable.size == 0:
        return []
    return sorted(
        {int(usable[k]) for k in np.round(np.linspace(0, usable.size - 1, SHOWN_PICTURES)).astype(int)}
    )


ALIVE = 0.5
"""Smallest share of valid points in a displayed frame, if there is such a frame."""


@dataclass(frozen=True)
class FullFieldView:
    """A full-field result, with a picture of camera 0."""

    name: str
    result: FullField
    frame: int
    """Frame of the picture: the last one with at least half of the points."""
    picture: NDArray[np.generic] | None
    """Camera 0's picture of this frame, shape [rows, columns]; None if it cannot be read."""


def read_full_field_view(name: str, result: FullField, pictures: Pictures) -> FullFieldView:
    """Choose the frame to show and read its picture. ``pictures``: camera 0's series."""
    shown = full_field_view(result, name)
    try:
        return replace(shown, picture=np.array(pictures.frame(shown.frame)))
    except PictureError:
        return shown


def full_field_view(result: FullField, name: str = "") -> FullFieldView:
    """Choose the frame to show, without a picture."""
    count = result.n_valid
    enough = np.flatnonzero(count >= max(1.0, ALIVE * count.max()))
    frame = int(enough[-1]) if enough.size else int(result.facts.get("reference", 0))
    return FullFieldView(name, result, frame, None)


def surface_view(result: StereoResult) -> SurfaceView:
    """A stereo result without pictures."""
    return SurfaceView("", result, {}, np.full((1, len(result.t)), np.nan))
