"""The pictures of a shot: opened, counted, compared with the shot file, and searched for the first change."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dic.files import regular
from dic.outcome import FrameOutcome
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError, refuse
from kolsky.base.files import read_errors
from kolsky.pictures.frames import read_frames
from kolsky.readers.measured_tables import FrameTable
from kolsky.schema.pictures import SeriesSection
from kolsky.schema.shot_file import ShotToml

if TYPE_CHECKING:
    from dic.images import FrameHealth, Pictures
    from dic.result import StereoResult


MOST_COMPARED = 400
"""Largest number of frames that are compared with the first one. In a longer series, they are evenly
spaced."""


@dataclass(frozen=True, eq=False)
class PictureChanges:
    """Difference of both cameras' pictures from their first ones."""

    time: FloatArray
    """Times of the compared frames on the shot's clock [s], shape [n]."""
    change: FloatArray
    """Mean absolute difference from the first picture, relative to white (2**bits - 1), shape [2, n]; NaN for
    an unreadable picture."""
    rest_end: float
    """Time of the last frame that is declared static [s]."""
    shown: tuple[tuple[float, FloatArray], ...]
    """Time [s] and picture of camera 0, relative to white, shape [rows, columns]. They are given for the
    first, the last static and the last frame, if readable."""


def picture_changes(series: Sequence[Pictures], time: FloatArray, static: int) -> PictureChanges:
    """Compare the pictures of both cameras with their first ones."""
    compared = np.unique(np.round(np.linspace(0, time.size - 1, min(time.size, MOST_COMPARED))).astype(int))
    change = np.full((len(series), compared.size), np.nan)
    for camera, pictures in enumerate(series):
        first = None
        for place, frame in enumerate(compared):
            picture = _relative(pictures, int(frame))
            if picture is None:
                continue
            first = picture if first is None else first
            change[camera, place] = np.abs(picture - first).mean()
    shown = ((i, _relative(series[0], i)) for i in dict.fromkeys((0, static - 1, time.size - 1)))
    return PictureChanges(
        time=time[compared],
        change=change,
        rest_end=float(time[static - 1]),
        shown=tuple((float(time[i]), picture) for i, picture in shown if picture is not None),
    )


def _relative(pictures: Pictures, frame: int) -> NDArray[np.float64] | None:
    """A picture relative to white; None if it cannot be read."""
    from dic.images import PictureError  # for shots with pictures only

    try:
        return np.asarray(pictures.frame(frame), dtype=np.float64) / float(2**pictures.bits - 1)
    except PictureError:
        return None


Progress = Callable[[str, int, int], None]
"""Receives the name of a stage, and the numbers of steps done and in all."""
CAMERAS = ("camera_0", "camera_1")
SERIES_CURE = "export one picture for each line of the frames' file"


@dataclass(frozen=True)
class PictureSet:
    """The pictures of a shot, which are opened but not read, and their times."""

    toml: ShotToml
    """The shot file."""
    frames: FrameTable
    """Frame numbers and times. Row k belongs to picture k."""
    series: tuple[Pictures, Pictures]
    """The series of both cameras, with the declared bits and offsets."""

    @property
    def time(self) -> FloatArray:
        """Frame times on the shot's clock [s], shape [n_frames]."""
        return self.frames.time + self.toml.declared.frames.clock_offset

    @cached_property
    def health(self) -> tuple[FrameHealth, FrameHealth]:
        """Inspection of every frame of both cameras."""
        from dic.images import frame_health

        return frame_health(self.series[0]), frame_health(self.series[1])

    @cached_property
    def changes(self) -> PictureChanges:
        """Changes of the pictures over time, with three example pictures."""
        return picture_changes(self.series, self.time, self.toml.declared.frames.static)

    @cached_property
    def inputs(self) -> dict[str, str]:
        """SHA-256 of pictures and calibration: name or pattern as declared -> hex digest."""
        declared, folder = self.toml.declared, self.toml.path.parent
        assert declared.pictures is not None  # else there are no pictures to be seen
        assert declared.calibration is not None
        calibration = declared.calibration
        sources = [series.source for series in declared.pictures.cameras]
        sources += [("file", calibration.file)] if calibration.file is not None else []
        patterns = (calibration.camera_0, calibration.camera_1)
        sources += [("pattern", pattern) for pattern in patterns if pattern is not None]
        return digests(folder, sources)


def open_source(folder: Path, kind: str, source: str | list[str]) -> Pictures:
    """The pictures of a "file", a "pattern" or a list of "files" in a folder. Raises as `dic.images`."""
    from dic.images import open_pictures as open_series

    if isinstance(source, list):
        return open_series([folder / one for one in source])
    place = folder / source
    return open_series(place) if kind == "file" else open_series(place.parent, pattern=place.name)


def digests(folder: Path, sources: Iterable[tuple[str, Any]]) -> dict[str, str]:
    """SHA-256 by name or pattern. ``sources``: "file", "pattern" or "files", and names in the folder."""
    found: dict[str, str] = {}
    for kind, name in sources:
        if kind == "pattern":
            place = folder / name  # its folders are taken literally
            found[name] = _digest(sorted(path for path in place.parent.glob(place.name) if path.is_file()))
        else:
            found |= {one: _digest([folder / one]) for one in ([name] if kind == "file" else name)}
    return found


def open_pictures(toml: ShotToml, frames: FrameTable) -> PictureSet:
    """Open both series of a shot.

    Only headers are read, and the last picture of a series that is too short. The remaining frames of a
    truncated file are used. The missing ones have the outcome UNREADABLE. Raises InputError if a series is
    missing or has no pictures, or if its number of pictures differs from that of the frames. The same error
    is raised if a crop differs from that in its file, or if the cameras' pictures differ in size.
    """
    from dic.images import PictureError, declared
    from dic.images.series import decode_once

    section = toml.declared.pictures
    assert section is not None  # the caller chose shots with pictures
    folder, found, problems = toml.path.parent, [], []
    for camera, series in zip(CAMERAS, section.cameras, strict=True):
        key, source = series.source
        dotted = f"pictures.{camera}.{key}"
        try:
            pictures = open_source(folder, key, source)
            problem = _miscounted(pictures, frames) or _moved(pictures, series)
            if problem:
                problems.append(toml.error(dotted, problem, cure=SERIES_CURE))
                continue
            offset, count = series.crop_offset, frames.frame.size
            found.append(declared(pictures, bits=section.bits, crop_offset=offset, n_frames=count))
        except PictureError as error:
            problems.append(toml.error(dotted, f"cannot be used: {error}"))
        except ValueError as error:
            problems.append(toml.error(dotted, str(error)))
    refuse(problems)
    first, second = found
    if first.shape != second.shape:
        raise toml.error(
            "pictures",
            f"have {first.shape[1]} x {first.shape[0]} px in camera 0 and {second.shape[1]} x "
            f"{second.shape[0]} px in camera 1",
            cure="export both with one crop size, or declare a pair that belongs together",
        )
    return PictureSet(toml=toml, frames=frames, series=(decode_once(first), decode_once(second)))


def check_frames(pictures: PictureSet) -> None:
    """Read every frame of both cameras once, and reject a series that cannot be correlated.

    Raises InputError with the first frame and the cause, see `dic.images.check_series`.
    """
    from dic.images import PictureError, check_series

    problems = []
    for camera, series, health in zip(CAMERAS, pictures.series, pictures.health, strict=True):
        try:
            check_series(series, health)
        except PictureError as error:
            problems.append(pictures.toml.error(f"pictures.{camera}", f"cannot be correlated: {error}"))
    refuse(problems)


def readable(pictures: Pictures) -> int:
    """Number of pictures up to the last readable one, smaller than the total in a truncated file."""
    readable = (k + 1 for k in reversed(range(pictures.n_frames)) if not _lost(pictures, k))
    return next(readable, 0)


def _digest(files: list[Path]) -> str:
    """SHA-256 of a file, or of the names and digests of several files."""
    found = []
    for path in files:
        with read_errors(path), regular(path).open("rb") as file:
            found.append(hashlib.file_digest(file, "sha256").hexdigest())
    if len(files) == 1:
        return found[0]
    listed = "\n".join(f"{path.name} {value}" for path, value in zip(files, found, strict=True))
    return hashlib.sha256(listed.encode("utf-8", errors="surrogateescape")).hexdigest()


def _miscounted(pictures: Pictures, frames: FrameTable) -> str | None:
    """Error text about the number of pictures. A truncated file may have too few."""
    count = frames.frame.size
    if pictures.n_frames == count:
        return None
    if pictures.n_frames < count and _lost(pictures, pictures.n_frames - 1):
        return None
    return f"holds {pictures.n_frames} pictures, {frames.path.name} lists {count} frames"


def _lost(pictures: Pictures, frame: int) -> bool:
    """True if a picture stated in the headers is missing."""
    from dic.images import PictureError  # for shots with pictures only

    try:
        pictures.frame(frame)
    except PictureError:
        return True
    return False


def _moved(pictures: Pictures, series: SeriesSection) -> str | None:
    """Error text about the declared crop, if it differs from the one stated in the file."""
    own = pictures.crop_offset
    if own in ((0.0, 0.0), series.crop_offset):
        return None
    return (
        f"states a crop at ({own[0]:g}, {own[1]:g}) px of the sensor, declared is {list(series.crop_offset)}"
    )


ALIVE = 0.5
"""Smallest share of valid points in the chosen pair, if there is such a frame."""


@dataclass(frozen=True)
class PicturePair:
    """The pictures of both cameras at one time, and their result."""

    result: StereoResult
    """The surfaces of the whole shot."""
    frame: int
    """Frame number, counted from 0."""
    pictures: tuple[NDArray[np.generic], NDArray[np.generic]]
    """The pictures of both cameras, each of shape [rows, columns]."""


def picture_pair(toml: ShotToml, result: StereoResult) -> PicturePair | str:
    """The latest pair with at least half of the points, or the reason why there is none.

    ``toml``: the shot's file, with [pictures].
    """
    from dic.images import PictureError

    try:
        first, second = open_pictures(toml, read_frames(toml)).series
    except InputError as error:
        return str(error)
    alive = np.where(result.outcome == FrameOutcome.VALID, result.specimen.n_valid, 0)
    if alive.size != first.n_frames:
        return f"there are {first.n_frames} pictures and surfaces of {alive.size} frames"
    enough = np.flatnonzero(alive >= max(1, ALIVE * result.specimen.surface.n_points))
    best = [int(np.argmax(alive))] if alive.any() else []
    for frame in [*enough[::-1].tolist(), *best]:
        try:
            pictures = np.array(first.frame(frame)), np.array(second.frame(frame))
        except PictureError:
            continue
        return PicturePair(result, frame, pictures)
    return "no frame with points can be read"
