"""Survey of a folder's pictures: series of the test and series of a calibration target.

Only unambiguous series are assigned: two series with one picture per frame, and two others with equal numbers
of pictures. The cameras are numbered by the order of the names. A remark states this.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.pictures.picture_set import MOST_COMPARED, open_source, picture_changes
from kolsky.survey.new_file import BLANK
from kolsky.survey.signals import Findings, quiet_stretch
from kolsky.survey.tables import Survey, quoted

ONE_FILE = (".tif", ".tiff", ".cine", ".mraw", ".h5", ".hdf5")
"""Endings of files that may contain a whole series."""
NUMBERED = (".tif", ".tiff", ".png", ".jpg", ".jpeg", ".bmp")
"""Endings of pictures of a numbered series."""
FEWEST = 3
"""Smallest number of pictures of a test or calibration series."""
_NUMBER = re.compile(r"(.*?)(\d{1,18})(\D*)", re.DOTALL)


@dataclass(frozen=True)
class SeriesEntry:
    """Pictures of one camera."""

    name: str
    """The file, or the pattern with one `*`, relative to the folder of the shot file."""
    key: str
    count: int
    shape: tuple[int, int]
    """Rows and columns [px]."""
    crop: tuple[float, float] | None
    """Position on the sensor (x, y) in the file [px]. None if the file does not contain it."""

    @property
    def said(self) -> str:
        """Description of the series in words."""
        return f"{self.name}: {self.count} pictures of {self.shape[1]} x {self.shape[0]} px"


@dataclass(frozen=True)
class PictureSurvey:
    """The picture series of a folder by their role in a shot."""

    test: tuple[SeriesEntry, ...] = ()
    """Both series of the test, in the order of their names. Empty if they are ambiguous."""
    target: tuple[SeriesEntry, ...] = ()
    """Both series of a calibration target. Empty if they are ambiguous."""
    others: tuple[SeriesEntry, ...] = ()
    """Series that could not be assigned."""


def survey_pictures(folder: Path, tables: Survey) -> PictureSurvey:
    """Survey the pictures in a folder and its direct subfolders. Nothing is written.

    ``tables``: its tables. The frames' file gives the number of pictures per camera.
    """
    series = sorted(_series(folder), key=lambda one: one.name)
    frames = tables.parts.get("frames")
    count = frames.time.values.size if frames is not None and frames.time is not None else None
    test = _pair([one for one in series if one.count == count])
    left = [one for one in series if one not in test]
    target = _pair([one for one in left if one.key == "pattern" and one.count != count]) if test else ()
    return PictureSurvey(test, target, tuple(one for one in left if one not in target))


def _pair(series: list[SeriesEntry]) -> tuple[SeriesEntry, ...]:
    """The series of two cameras; empty unless there are exactly two, equal in number and size of pictures."""
    alike = len(series) == 2 and len({(one.count, one.shape) for one in series}) == 1
    return tuple(series) if alike else ()


def _series(folder: Path) -> Iterator[SeriesEntry]:
    """Every series in a folder and its subfolders. Files that cannot be opened are left out."""
    from dic.images import PictureError

    whole: list[str] = []
    numbered: Counter[str] = Counter()
    below = (p for p in sorted(folder.iterdir()) if p.is_dir() and p.name != "results")
    for place in (folder, *below):
        for path in sorted(p for p in place.iterdir() if p.is_file()):
            name = path.relative_to(folder).as_posix()
            if (number := _NUMBER.fullmatch(path.stem)) and path.suffix.lower() in NUMBERED:
                pattern = f"{number[1]}*{number[3]}{path.suffix}"
                numbered[(path.parent / pattern).relative_to(folder).as_posix()] += 1
            if path.suffix.lower() in ONE_FILE:
                whole.append(name)
    patterns = [pattern for pattern, count in numbered.items() if count >= FEWEST]
    for key, names in (("file", whole), ("pattern", patterns)):
        for name in names:
            try:
                pictures = open_source(folder, key, name)
            except (PictureError, OSError):
                continue
            if pictures.n_frames >= FEWEST:
                crop = pictures.crop_offset if pictures.crop_offset != (0.0, 0.0) else None
                yield SeriesEntry(name, key, pictures.n_frames, pictures.shape, crop)


def first_change(folder: Path, survey: PictureSurvey) -> tuple[int, str] | None:
    """Index of the first picture of camera 0 that clearly differs from the previous ones, and its series.

    None if there is no such picture. Only the first `MOST_COMPARED` pictures are searched.
    """
    from dic.images import PictureError

    if not survey.test:
        return None
    series = survey.test[0]
    try:
        pictures = open_source(folder, series.key, series.name)
    except (PictureError, OSError):
        return None
    frames = np.arange(min(pictures.n_frames, MOST_COMPARED), dtype=np.float64)
    quiet = quiet_stretch(picture_changes([pictures], frames, 1).change[0, 1:], fewest=FEWEST)
    return None if quiet is None else (quiet.count + 1, series.name)


def picture_findings(pictures: PictureSurvey, shown: Findings) -> None:
    """Add all values that follow unambiguously from the pictures. Remarks give the order of the cameras."""
    whole = {one.shape for one in pictures.target}
    for camera, one in enumerate(pictures.test):
        crop = '["", ""]'
        if one.crop is not None:
            crop = f"[{one.crop[0]:g}, {one.crop[1]:g}]"
        elif {one.shape} == whole:
            crop = "[0, 0]"  # the test's pictures are as large as the target's: no crop
        value = f"{{ {one.key} = {quoted(one.name)}, crop_offset = {crop} }}"
        note = f"{one.said}; camera {camera} by the order of the names"
        shown.add(f"pictures.camera_{camera}", value, note)
    for camera, one in enumerate(pictures.target):
        note = f"{one.said}; crop_offset counts from their top left pixel"
        shown.add(f"calibration.camera_{camera}", quoted(one.name), note)
    if pictures.target:
        facts = ("distortion", "target.kind", "target.columns", "target.rows")
        shown.values |= {"calibration.file": None, **{f"calibration.{fact}": BLANK for fact in facts}}
