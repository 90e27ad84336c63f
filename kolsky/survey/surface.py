"""Survey of a folder's exports of DIC programs: series of files, their program, axes, rest and noise.

A program is recognised by its column headings. The flyer's series and the axes of the test are identified
from the motion; if the motion is ambiguous, they stay blank.
"""

from __future__ import annotations

import glob
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.dic_export import DicExport, PointState, matching, programs_of, read
from kolsky.survey.signals import Findings, QuietStretch, quiet_stretch, two_figures

SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc")
"""Endings of exports."""
FEWEST = 3
"""Smallest number of files of a series, because a shot needs this many static frames."""
ONE_BODY = 0.05
"""Largest scatter of the points' displacements for a rigid body, divided by its travel [-]. For a compressed
specimen with half of its height in view it is 0.5 / sqrt(12) = 0.14."""
PRESSED = 0.10
"""Smallest scatter of the points' displacements for a compressed specimen, divided by their travel [-]."""
ALONG_AXIS = 0.9
"""Smallest share of a motion along an axis of the program that makes it the test's axis. It allows an angle
of 26 degrees."""
CLEARLY = 3.0
"""Smallest ratio of the larger to the smaller of two motions for an unambiguous choice [-]."""
ARC = 0.088
"""Smallest ratio of depth to width of a patch that shows a cylinder's curvature. An arc of 20 degrees to each
side has tan(10 degrees) / 2."""
FEWEST_OF_CYLINDER = 30
"""Smallest number of points for a cylinder fit."""
PLAUSIBLE = (0.5e-3, 0.5)
"""Range of plausible extents of a specimen's points [m]. Outside it, the unit is wrong."""
_AXES = "XYZ"


@dataclass(frozen=True)
class SeriesOfExports:
    """A series of exports, one file per frame."""

    pattern: str
    """The files, relative to the folder of the shot file."""
    program: str
    """Key of `LAYOUTS`."""
    unit: str
    """Unit of its lengths; empty if unknown."""
    why_unit: str
    """Source of the unit, as text."""
    export: DicExport

    @property
    def motion(self) -> FloatArray:
        """Mean displacement of the points valid in every frame [m], shape [n_frames, 3]; 0 without any."""
        if not self._complete.any():
            return np.zeros((len(self.export.u), 3))
        return np.asarray(self.export.u[:, self._complete].mean(axis=1))

    @property
    def one_body(self) -> bool | None:
        """True if it moves as a rigid body. None if this is ambiguous."""
        u = self.export.u[:, self._complete]
        if u.shape[1] < 2:
            return None
        travel = np.linalg.norm(u.mean(axis=1), axis=1)
        frame = int(np.argmax(travel))
        if travel[frame] == 0.0:
            return None
        spread = float(np.linalg.norm(u[frame].std(axis=0))) / float(travel[frame])
        return True if spread < ONE_BODY else (False if spread > PRESSED else None)

    @property
    def _complete(self) -> np.ndarray:
        return np.asarray((self.export.state == PointState.VALID).all(axis=0))


@dataclass(frozen=True)
class SurfaceSurvey:
    """The exports of a folder by their role in a shot."""

    specimen: SeriesOfExports | None = None
    flyer: SeriesOfExports | None = None
    files: frozenset[Path] = frozenset()
    """Every file of a series that has a program's headings."""
    doubtful: Mapping[str, str] = field(default_factory=dict)
    """Pattern -> reason why the series was not used."""


def survey_surfaces(folder: Path) -> SurfaceSurvey:
    """Find series of exports in a folder and all its subfolders."""
    doubtful: dict[str, str] = {}
    files: set[Path] = set()
    series = []
    for pattern, paths in _numbered(folder):
        programs = programs_of(paths[0])
        if not programs:
            continue
        files |= set(paths)
        if "*" not in pattern:
            doubtful[pattern] = "it and files like it differ in several numbers: name them by frame alone"
            continue
        if len(programs) > 1:
            doubtful[pattern] = f"its headings are those of {' and '.join(programs)}"
            continue
        try:
            if set(matching(folder, pattern)) != set(paths):
                doubtful[pattern] = "other files have such names too: put each series into a folder"
                continue
            series.append(_read(pattern, paths, next(iter(programs.items()))))
        except InputError as error:
            doubtful[pattern] = error.message
    if len(series) == 1:  # a shot cannot have a flyer only
        return SurfaceSurvey(series[0], None, frozenset(files), doubtful)
    parts = {part: [s for s in series if s.one_body is part] for part in (True, False, None)}
    for one in parts[None]:
        doubtful[one.pattern] = (
            "its points that are valid in every frame do not move as one body or as a compressed specimen"
        )
    for part, words in ((True, "the flyer"), (False, "the specimen")):
        if len(parts[part]) > 1:
            names = ", ".join(one.pattern for one in parts[part])
            doubtful |= {
                one.pattern: f"could be {words}, and so could each of {names}" for one in parts[part]
            }
    chosen = {part: series[0] for part, series in parts.items() if len(series) == 1}
    return SurfaceSurvey(chosen.get(False), chosen.get(True), frozenset(files), doubtful)


def _numbered(folder: Path) -> Iterator[tuple[str, list[Path]]]:
    """Pattern and files of each series; the first file's name if the names differ in several numbers."""
    groups: dict[tuple[Path, str], list[Path]] = {}
    if not folder.is_dir():
        return
    for path in sorted(folder.rglob("*")):
        below = path.relative_to(folder)
        hidden = any(part.startswith(".") for part in below.parts)
        if path.suffix.lower() in SUFFIXES and not hidden and below.parts[0] != "results" and path.is_file():
            groups.setdefault((path.parent, re.sub(r"\d+", "0", path.name)), []).append(path)
    for paths in groups.values():
        numbers = [re.findall(r"\d+", path.stem) for path in paths]
        varied = [i for i in range(len(numbers[0])) if len({group[i] for group in numbers}) > 1]
        if len(paths) < FEWEST:
            continue
        if len(varied) != 1:
            yield paths[0].relative_to(folder).as_posix(), paths
            continue
        pieces = list(map(glob.escape, re.split(r"(\d+)", paths[0].name)))
        pieces[2 * varied[0] + 1] = "*"
        name = "".join(pieces)
        place = glob.escape(paths[0].parent.relative_to(folder).as_posix())
        yield (name if place == "." else f"{place}/{name}"), paths


def _read(pattern: str, paths: list[Path], layout: tuple[str, tuple[str, ...]]) -> SeriesOfExports:
    """The points of a series, with the unit of the headings, otherwise mm if their extent is plausible."""
    program, stated = layout
    export = read(paths, program)
    extent = float(np.ptp(export.X, axis=0).max())
    size = f"{1e3 * extent:.3g}"
    if stated:
        unit, why = stated[0] if len(stated) == 1 else "", "the headings state it"
    elif PLAUSIBLE[0] <= extent <= PLAUSIBLE[1]:
        unit = "mm"
        why = f"the headings state none: mm, the program's usual one; the points span {size} in it"
    else:
        unit, why = "", f"the headings state none, and the points span {size} in it"
    return SeriesOfExports(pattern, program, unit, why, export)


def axis_toward_flyer(survey: SurfaceSurvey) -> tuple[str, str] | None:
    """The program's axis toward the flyer and the evidence for it. None if no motion shows it."""
    if survey.flyer is not None:
        motion = survey.flyer.motion
        way = motion[int(np.argmax(np.linalg.norm(motion, axis=1)))]
        along = int(np.argmax(np.abs(way)))
        if np.abs(way[along]) < ALONG_AXIS * np.linalg.norm(way):
            return None
        toward = f"{'-' if way[along] > 0.0 else '+'}{_AXES[along]}"
        return toward, f"the flyer moves along {_opposite(toward)}"
    if survey.specimen is None:
        return None
    export, motion = survey.specimen.export, survey.specimen.motion
    frame = int(np.argmax(np.linalg.norm(motion, axis=1)))
    valid = export.state[frame] == PointState.VALID
    X, u = export.X[valid], export.u[frame, valid]
    extent = np.ptp(X, axis=0)
    wide = extent > 0.2 * extent.max()  # along a shorter extent the slope depends on noise
    slopes = np.array([np.polyfit(X[:, k], u[:, k], 1)[0] if wide[k] else 0.0 for k in range(3)])
    along = int(np.argmin(slopes))
    others = np.delete(slopes, along)
    one_way = np.abs(u[:, along].mean()) > 0.25 * np.abs(u[:, along]).max()
    if slopes[along] > -0.02 or CLEARLY * others.min() < slopes[along] or not one_way:
        return None
    toward = f"{'-' if u[:, along].mean() > 0.0 else '+'}{_AXES[along]}"
    return toward, f"the specimen shortens along it, and its points move along {_opposite(toward)}"


def axis_toward_cameras(series: SeriesOfExports, y: str) -> tuple[str, str] | None:
    """The program's axis toward the cameras, to which the side is convex, and the evidence for it."""
    motion = series.motion
    across = [k for k in range(3) if _AXES[k] != y[1]]
    way = motion[int(np.argmax(np.abs(motion[:, _AXES.index(y[1])])))][across]
    order = np.argsort(-np.abs(way))
    large, small = way[order[0]], way[order[1]]
    if large == 0.0 or np.abs(large) < CLEARLY * np.abs(small):
        return None
    toward = f"{'+' if large > 0.0 else '-'}{_AXES[across[int(order[0])]]}"
    return toward, f"the surface bulges by {1e3 * abs(large):.2g} mm in the mean along it"


def quiet_frames(series: SeriesOfExports) -> QuietStretch | None:
    """The frames before the mean motion of a series, with the reference; None if they are not clear."""
    # The reference has no displacement and no noise.
    rests = [quiet_stretch(component[1:], fewest=FEWEST) for component in series.motion.T]
    first = min((quiet for quiet in rests if quiet), key=lambda quiet: quiet.count, default=None)
    return None if first is None else QuietStretch(first.count + 1, first.level, first.scatter)


def scatter_at_rest(series: SeriesOfExports, count: int) -> float | None:
    """Noise of a point's noisiest component [m] by differences of ``count`` static frames, or None."""
    steps = np.diff(series.export.u[1:count], axis=0)
    if steps.shape[0] < 2:
        return None
    with np.errstate(invalid="ignore"):
        sigma = float(np.sqrt(np.nanmean(steps**2, axis=(0, 1)) / 2.0).max())
    return sigma if np.isfinite(sigma) and sigma > 0.0 else None


def surface_values(survey: SurfaceSurvey, shown: Findings) -> None:
    """Add the values of [surface] with the evidence from the exports."""
    from scipy.spatial import cKDTree

    series = survey.specimen
    if series is None:
        return
    export = series.export
    note = (
        f"{len(export.paths)} files of {export.program}: frames {export.frame[0]} to {export.frame[-1]}, "
        f"{len(export.X)} points"
    )
    if series.one_body is not False:
        note += "; do they show the specimen? They do not clearly shorten"
    shown.add("surface.pattern", f'"{series.pattern}"', note)
    shown.values["surface.program"] = f'"{series.program}"'
    shown.add("surface.unit", f'"{series.unit}"', series.why_unit)
    y = axis_toward_flyer(survey)
    Z = axis_toward_cameras(series, y[0]) if y else None
    for key, axis in (("y", y), ("Z", Z)):
        toward, why = axis or ("", "the motion of the points does not show it clearly")
        shown.add(f"surface.{key}", f'"{toward}"', why)
    shown.values["surface.frame"] = '""'
    low, high = 1e3 * export.X.min(axis=0), 1e3 * export.X.max(axis=0)
    spans = ", ".join(f"{_AXES[k]} from {low[k]:.3g} to {high[k]:.3g} mm" for k in range(3))
    origin = f"the points at rest have {spans}"
    if y and Z:
        along = _AXES.index(y[0][1])
        end = (low if y[0][0] == "+" else high)[along]
        extent = np.ptp(export.X, axis=0)
        facing = _AXES.index(Z[0][1])
        depth, width = extent[facing], extent[3 - along - facing]  # the third axis: 0 + 1 + 2 = 3
        if len(export.X) >= FEWEST_OF_CYLINDER and depth >= ARC * width > 0.0:
            shown.add(
                "surface.frame", '"cylinder"', "the points show the curve of the side: the axis by best fit"
            )
            example = ", ".join(f'"{end:.3g} mm"' if k == along else '"0 mm"' for k in range(3))
            origin += f"; with a best fit only {y[0][1]} counts, e.g. [{example}] at the end of the points"
        else:
            why = "the points are too few, or too near to one line, for the fit of a cylinder"
            shown.add("surface.frame", '"declared"', why)
            origin += f"; the end at the platen is near {y[0][1]} = {end:.3g} mm"
    shown.add("surface.origin", '["", "", ""]', origin)
    neighbour, _ = cKDTree(export.X).query(export.X, k=2)
    wide = two_figures(1.5 * float(np.median(neighbour[:, 1])))
    shown.add(
        "surface.half_width",
        f'"{1e3 * wide:.4g} mm"',
        "1.5 times the distance of the points: one to three columns of them",
    )
    quiet = quiet_frames(series)
    sigma = scatter_at_rest(series, quiet.count) if quiet else None
    shown.add(
        "surface.sigma",
        f'"{1e6 * two_figures(sigma):.4g} um"' if sigma else '""',
        "scatter of the frames at rest" if sigma else "no frames at rest show it",
    )
    if survey.flyer is not None:
        still = quiet_frames(survey.flyer)
        size = f"{1e6 * two_figures(still.scatter):.4g} um" if still else ""
        why = (
            "sigma is the scatter of its mean motion at rest" if still else "no frames at rest show its sigma"
        )
        value = f'{{ pattern = "{survey.flyer.pattern}", sigma = "{size}" }}'
        shown.add("surface.flyer", value, f"it moves as one body; {why}")


def first_motion(survey: SurfaceSurvey) -> tuple[int, str] | None:
    """Number of the first frame in which specimen or flyer moves, and the files that show it.

    The earlier of both is safe, because the specimen rests until the flyer moves. None if it is not clear.
    """
    if survey.specimen is None or quiet_frames(survey.specimen) is None:
        return None
    firsts = [
        (int(one.export.frame[quiet.count]), one.pattern)
        for one in (survey.specimen, survey.flyer)
        if one is not None and (quiet := quiet_frames(one)) is not None
    ]
    return min(firsts)


def _opposite(axis: str) -> str:
    return f"{'-' if axis[0] == '+' else '+'}{axis[1]}"
