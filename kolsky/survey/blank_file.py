"""The shot file that a new shot begins with: a blank one, with what the files of its folder show."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from kolsky.survey.evidence import evidence
from kolsky.survey.new_file import (
    fill_in,
    next_of_series,
    notes_of,
    values_of,
    with_notes,
    with_recordings,
)
from kolsky.survey.pictures import PictureSurvey, first_change, picture_notes, picture_values
from kolsky.survey.surface import SurfaceSurvey
from kolsky.survey.tables import Survey


def new_text(
    contents: Survey,
    folder: Path,
    *,
    bars: bool = False,
    pictures: PictureSurvey | None = None,
    last: str | None = None,
) -> str:
    """The text of the new shot file: the blank one, or the last shot's, with what the files say."""
    if last is not None:
        return with_notes(next_of_series(last, folder, contents), notes_of(contents))
    text = template(bars=bars, pictures=pictures is not None)
    if bars:
        return with_recordings(text, contents)
    motion = None
    if pictures is not None:
        motion = first_change(folder, pictures)
    shown = evidence(contents, motion)
    values, notes = {**values_of(contents), **shown.values}, {**notes_of(contents), **shown.notes}
    if pictures is None:
        text = with_surface(text, contents.surface)
        values = {key: value for key, value in values.items() if f"\n[{key.partition('.')[0]}]" in text}
    else:
        others = ("flyer.", "centre_line.", "surface.")
        values = {key: value for key, value in values.items() if not key.startswith(others)}
        values |= picture_values(pictures)
        notes |= picture_notes(pictures)
        if pictures.target:
            text = text.replace("# [calibration.target]", "[calibration.target]", 1)
    return with_notes(fill_in(text, values), notes)


def with_surface(text: str, found: SurfaceSurvey) -> str:
    """The blank file with [surface] in place of what its exports give: [centre_line], and [flyer] with it."""
    if found.specimen is None:
        return text
    text = text[: text.index("[centre_line]")] + text[text.index("# [surface]") + 2 :]
    if found.flyer is not None:
        text = text[: text.index("[flyer]")] + text[text.index("[surface]") :]
    return text


def template(*, bars: bool = False, pictures: bool = False) -> str:
    """The blank shot.toml that every new shot begins with: with exports, with pictures, or between bars."""
    text = _resource("bars.toml" if bars else "shot.toml")
    if not pictures:
        return text
    before, after = text.index("[flyer]"), text.index("# [reporting]")
    return text[:before] + _resource("pictures.toml") + text[after:]


def _resource(name: str) -> str:
    return files("kolsky").joinpath("cli", "templates", name).read_text(encoding="utf-8")
