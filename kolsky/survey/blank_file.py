"""Values that follow from the data files of a folder: signs, rest, noise and ranges.

`kolsky new` writes values that are clear. Other values stay blank. A remark gives the reason in both cases.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.files import beginning, decode, read_bytes, template_file
from kolsky.base.toml import TOML_LIMIT
from kolsky.base.units import unit_factor
from kolsky.readers.recordings import read_contents
from kolsky.schema.shot_file import SHOT_FILE, find_shot_file
from kolsky.survey.new_file import fill_in, next_of_series, table_findings, with_notes, with_recordings
from kolsky.survey.pictures import PictureSurvey, first_change, picture_findings, survey_pictures
from kolsky.survey.signals import (
    FEWEST_SAMPLES,
    Findings,
    QuietStretch,
    common_sign,
    first_push,
    quiet_stretch,
    range_above,
    relative_scatter,
    two_figures,
)
from kolsky.survey.surface import SurfaceSurvey, first_motion, surface_values
from kolsky.survey.tables import SHIFT, Survey, TableEntry, clock_text, microseconds, survey

SPARE = 0.9
"""Used share of the quiet part of a record. Motion and force may begin below the noise."""
FEWEST_STATIC = 3
"""Smallest number of static frames of a shot."""
_COMPRESSION = re.compile(r"compress|druck|stauch|crush", re.IGNORECASE)
_TENSION = re.compile(r"tens(ile|ion)|zugv|zugs|traction|dehn?versuch", re.IGNORECASE)


def evidence(found: Survey, picture: tuple[int, str] | None, shown: Findings) -> None:
    """Add all values that follow from the data files of a folder.

    ``found``: the files. ``picture``: for a shot with pictures, the index of the first picture with motion,
    and its series.
    """
    surface_values(found.surface, shown)
    last_static = _frames(found, picture, shown)
    if "force" in found.parts:
        _force(found.parts["force"], last_static, shown)
    if "flyer" in found.parts:
        _flyer(found.parts["flyer"], shown)
    if "curve" in found.parts:
        _curve(found.parts["curve"], shown)


def _frames(found: Survey, picture: tuple[int, str] | None, shown: Findings) -> float | None:
    """Add the static frames. Returns the time of the last static frame on the frames' clock [s], if known."""
    frames = found.parts.get("frames", found.parts.get("flyer"))
    if frames is None or frames.frame is None:
        return None
    numbers = frames.frame.values
    series = found.surface.specimen
    if series is not None and (stray := np.setdiff1d(series.export.frame, numbers)).size:
        shown.notes["frames.file"] = (
            f"frame {stray[0]} of {series.pattern} is not in {frames.path.name}: number both alike"
        )
        return None
    by_flyer = _flyer_motion(found.parts["flyer"]) if "flyer" in found.parts else None
    motion = min(filter(None, (first_motion(found.surface), by_flyer)), default=None)
    if picture is not None and picture[0] < numbers.size:
        motion = int(numbers[picture[0]]), picture[1]
    if motion is None:
        return None
    first, source = motion
    static = int(SPARE * (numbers < first).sum())
    if static < FEWEST_STATIC:
        return None
    shown.add(
        "frames.static",
        str(static),
        f"{source}: the first clear motion is in frame {first}; a tenth of the frames before it is spare",
    )
    if frames.time is None or not frames.time.unit:
        return None
    return float(frames.time.values[static - 1]) * unit_factor(frames.time.unit, "s")


def _flyer_motion(table: TableEntry) -> tuple[int, str] | None:
    """Number of the first frame in which the flyer, and with it the specimen, moves, and its file."""
    quiet = _flyer_quiet(table)
    if quiet is None or table.frame is None:
        return None
    return int(table.frame.values[quiet.count]), table.path.name


def _flyer_quiet(table: TableEntry) -> QuietStretch | None:
    column = table.displacement
    return None if column is None else quiet_stretch(column.values, fewest=FEWEST_STATIC)


def _flyer(table: TableEntry, shown: Findings) -> None:
    """Add the sign of the flyer's motion and its noise."""
    column, quiet = table.displacement, _flyer_quiet(table)
    if column is None or quiet is None:
        return
    sign = first_push(column.values, quiet)
    if sign is not None:
        way = "toward" if sign > 0 else "away from"
        word = "grows" if sign > 0 else "falls"
        shown.add(
            "flyer.positive", f'"{way} specimen"', f"the flyer hits the specimen, and its column {word}"
        )
    sigma = 1e6 * two_figures(quiet.scatter * unit_factor(column.unit, "m"))
    shown.add("flyer.sigma", f'"{sigma:.4g} um"', f"scatter of the {quiet.count} frames at rest")


def _volts(table: TableEntry) -> FloatArray | None:
    """Samples of the transmitted force [V]. None if its column is not clear."""
    column = table.voltage
    if column is None or column.dimension != "V":
        return None
    values = column.values
    if not values.size:  # a recorder's format, whose samples have not been read
        channel = next(c for c in read_contents(table.path).channels if c.name == column.name)
        values = channel.values()
    return np.asarray(values * unit_factor(column.unit, "V"))


def _force(table: TableEntry, last_static: float | None, shown: Findings) -> None:
    """Add clock, baseline, sign and range of the transmitted force."""
    span = clock_text(table)
    shown.add(
        "force.clock_offset", '"0 us"', f"{table.path.name}: {span or SHIFT}; the shot's clock is this clock"
    )
    volts = _volts(table)
    if volts is None:
        return
    if (largest := range_above(volts)) is None:
        shown.notes["force.full_scale"] = (
            f"{np.abs(volts).max():.4g} V is there many times in a row: was the recorder's range exceeded?"
        )
    else:
        shown.add(
            "force.full_scale",
            f'"{largest:g} V"',
            f"largest sample {np.abs(volts).max():.4g} V, not clipped; write the recorder's range if known",
        )
    times, quiet = table.times, quiet_stretch(volts, fewest=FEWEST_SAMPLES)
    times = None if times is None or times.size != volts.size else times
    if times is not None and quiet is None:
        example = f'["{_time(times[0], later=True)}", "{_time(times[times.size // 10])}"]'
        shown.notes["force.baseline"] = f"no clear quiet stretch at the beginning; write it, e.g. {example}"
    if quiet is None:
        return
    if (sign := first_push(volts, quiet)) is not None:
        word = "positive" if sign > 0 else "negative"
        rise = "rise" if sign > 0 else "fall"
        note = f"the test begins with compression, and the first and largest change is a {rise}"
        shown.add("force.compression", f'"{word}"', note)
    if times is None:
        return
    end = float(times[int(SPARE * quiet.count)])
    note = f"the record is quiet until {microseconds(float(times[quiet.count]))}"
    if last_static is not None and times[FEWEST_SAMPLES] < last_static < end:
        end = last_static
        note += '; the baseline ends with the last frame at rest, for frames.clock_offset = "0 us"'
    shown.add("force.baseline", f'["{_time(float(times[0]), later=True)}", "{_time(end)}"]', note)


def _time(seconds: float, *, later: bool = False) -> str:
    """A time rounded to a nanosecond toward the inside of its interval; ``later``: it is the beginning."""
    nanoseconds = 1e9 * seconds
    whole = np.ceil(nanoseconds - 1e-4) if later else np.floor(nanoseconds + 1e-4)  # doubles near 60 s: 1e-5
    return f"{whole / 1e3:.14g} us"


def _curve(table: TableEntry, shown: Findings) -> None:
    """Add convention, branch and scatter of the quasi-static curve."""
    strain, stress = table.strain, table.stress
    if strain is None or stress is None:
        return
    signs = common_sign(strain.values), common_sign(stress.values)
    words = " ".join((table.path.stem, strain.name, stress.name))
    named = {"compression": bool(_COMPRESSION.search(words)), "tension": bool(_TENSION.search(words))}
    if signs == (-1, -1):
        note = "strain and stress are negative: compression, with tension positive"
        shown.add("curve.convention", '"tension positive"', note)
        shown.add("curve.branch", '"compression"', "strain and stress are negative")
    elif signs == (1, 1) and sum(named.values()) == 1:
        branch = "compression" if named["compression"] else "tension"
        note = f"strain and stress are positive, and the names of file or columns mean {branch}"
        shown.add("curve.convention", f'"{branch} positive"', note)
        shown.add("curve.branch", f'"{branch}"', note)
    else:
        note = (
            "strain and stress are positive: a tension test, or a compression test with compression positive"
            if signs == (1, 1)
            else "strain and stress do not have one common sign"
        )
        shown.notes |= {"curve.convention": note, "curve.branch": note}
    scatter = relative_scatter(strain.values, stress.values)
    if scatter is not None and scatter >= 1e-5:  # smaller values are rounding of the printed digits
        shown.add(
            "curve.relative_sigma",
            f'"{100.0 * two_figures(scatter):.4g} %"',
            "scatter of neighbouring points; an error of all points together belongs to [uncertainty]",
        )


def write_new(
    folder: Path, *, bars: bool = False, pictures: bool = False, previous: Path | None = None
) -> tuple[Path, Survey, PictureSurvey | None]:
    """Write a new shot.toml into a folder: the file, and what was found in the folder.

    ``bars``, ``pictures``: for a test between bars, or one measured from pictures. ``previous``: the last
    shot of a series. Raises InputError if the folder has a shot file already, or cannot be used.
    """
    last, series = None, None
    if previous is not None:
        file_of_last = find_shot_file(previous)
        last = decode(file_of_last, read_bytes(file_of_last, limit=TOML_LIMIT))
    path = folder / SHOT_FILE
    with beginning(path):
        contents = survey(folder)
        series = survey_pictures(folder, contents) if pictures else None
        text = new_text(contents, folder, bars=bars, pictures=series, last=last)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    return path, contents, series


def new_text(
    contents: Survey,
    folder: Path,
    *,
    bars: bool = False,
    pictures: PictureSurvey | None = None,
    last: str | None = None,
) -> str:
    """The text of the new shot file: the blank one or the last shot's, completed from the files."""
    shown = table_findings(contents)
    if last is not None:
        return with_notes(next_of_series(last, folder, contents), shown.notes)
    text = template(bars=bars, pictures=pictures is not None)
    if bars:
        return with_recordings(text, contents)
    evidence(contents, None if pictures is None else first_change(folder, pictures), shown)
    if pictures is None:
        text = with_surface(text, contents.surface)
        values = {key: v for key, v in shown.values.items() if f"\n[{key.partition('.')[0]}]" in text}
    else:
        others = ("flyer.", "centre_line.", "surface.")
        shown.values = {key: value for key, value in shown.values.items() if not key.startswith(others)}
        picture_findings(pictures, shown)
        values = shown.values
        if pictures.target:
            text = text.replace("# [calibration.target]", "[calibration.target]", 1)
    return with_notes(fill_in(text, values), shown.notes)


def with_surface(text: str, found: SurfaceSurvey) -> str:
    """The blank file with [surface] instead of [centre_line], and of [flyer] if exports show the flyer."""
    if found.specimen is None:
        return text
    text = text[: text.index("[centre_line]")] + text[text.index("# [surface]") + 2 :]
    if found.flyer is not None:
        text = text[: text.index("[flyer]")] + text[text.index("[surface]") :]
    return text


def template(*, bars: bool = False, pictures: bool = False) -> str:
    """The blank shot.toml for a new shot: with exports, with pictures, or between bars."""
    text = template_file("bars.toml" if bars else "shot.toml")
    if not pictures:
        return text
    before, after = text.index("[flyer]"), text.index("# [reporting]")
    return text[:before] + template_file("pictures.toml") + text[after:]
