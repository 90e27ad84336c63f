"""Fields of an image correlation: values of `dic.h5` at the points of one surface, in every frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from dic.outcome import PointOutcome
from dic.result import StereoResult, SurfaceStrain
from dic.surfaces.surface_history import SurfaceHistory
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.pictures.dic_file import read_full_field, read_stereo_result
from kolsky.schema.pictures import find_measurement_file
from kolsky.shot.optical_data import RESULT_FILE

OUTCOME = "outcome"
"""Name of the field of `PointOutcome`."""
PERCENT = 100.0


@dataclass(frozen=True)
class FieldOfPoints:
    """A field with a value for each point and frame."""

    symbol: str
    """Symbol, as on an axis."""
    label: str
    """Quantity with its unit, for a list."""
    unit: str
    """Unit of its values: "mm", "µm", "px" or "%". Outcomes have ""."""
    values: FloatArray
    """Values, shape [n_frames, n_points]; NaN without a measurement."""
    sigma: FloatArray | None = None
    """Their standard deviations, same shape. None for outcomes and for a field of standard deviations."""


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Points of one surface that the cameras tracked."""

    name: str
    """Specimen, flyer or surface."""
    surface: SurfaceHistory
    """Their motion."""
    pixels: tuple[FloatArray, ...]
    """Coordinates in each camera's pictures [px], each [n_frames, n_points, 2]; NaN for a lost point."""
    reference: FloatArray
    """Pixel coordinates in the reference picture of camera 0 [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""
    strain: SurfaceStrain | None
    """Strains; None if none were computed for this body."""
    unit: str = "m"
    """Unit of the surface: "m" or "px"."""
    plane: bool = False
    """True for a plane seen by one camera. It has no out-of-plane motion, and y points down."""
    timed: bool = True
    """False if the times count frames."""

    @property
    def length(self) -> tuple[float, str]:
        """Factor and unit in which lengths are shown."""
        return (1e3, "mm") if self.unit == "m" else (1.0, "px")

    @cached_property
    def fields(self) -> dict[str, FieldOfPoints]:
        """Every field by its name: displacements, strains, their standard deviations, outcomes."""
        (factor, unit), surface = self.length, self.surface
        (fine, small) = (1e6, "µm") if self.unit == "m" else (1e3, "mpx")
        valid = surface.valid
        found: dict[str, FieldOfPoints] = {}
        spreads: dict[str, FieldOfPoints] = {}
        for i, name in enumerate("UV" if self.plane else "UVW"):
            u, sigma = (np.where(valid, part[..., i], np.nan) for part in (surface.u, surface.sigma))
            found[name] = FieldOfPoints(
                name, f"displacement {name} ({unit})", unit, factor * u, factor * sigma
            )
            spreads[f"sigma {name}"] = FieldOfPoints(
                f"σ({name})", f"standard deviation of {name} ({small})", small, fine * sigma
            )
        if self.strain is not None:
            names = ("xx", "yy", "xy") if self.name == "surface" else ("θθ", "yy", "θy")
            for i, name in enumerate(names):
                E, sigma = (PERCENT * part[..., i] for part in (self.strain.value, self.strain.sigma))
                found[f"E{name}"] = FieldOfPoints(f"E{name}", f"strain E{name} (%)", "%", E, sigma)
                spreads[f"sigma E{name}"] = FieldOfPoints(
                    f"σ(E{name})", f"standard deviation of E{name} (%)", "%", sigma
                )
        outcome = FieldOfPoints("", "outcome", "", surface.outcome.astype(np.float64))
        return {**found, **spreads, OUTCOME: outcome}

    def outcomes(self, frame: int) -> dict[PointOutcome, int]:
        """Number of points of each outcome in a frame, the most frequent first."""
        numbers, counts = np.unique(self.surface.outcome[frame], return_counts=True)
        order = np.argsort(-counts, kind="stable")
        return {PointOutcome(int(numbers[i])): int(counts[i]) for i in order}

    def places(self, camera: int, frame: int) -> FloatArray:
        """Pixel coordinates of all points in a picture [px], shape [n_points, 2].

        A lost point has its last known place. It is NaN if the camera has not seen the point before.
        """
        history = self.pixels[camera][: frame + 1]
        known = np.asarray(np.isfinite(history).all(axis=2))
        last = frame - np.argmax(known[::-1], axis=0)
        places = history[last, np.arange(history.shape[1])]
        unseen = ~known.any(axis=0)
        if camera == 0:
            places[unseen] = self.reference[unseen]
        return np.asarray(places)

    def nearest(self, camera: int, frame: int, place: tuple[float, float]) -> int | None:
        """Number of the point nearest to (x, y) in a picture [px]; None if the picture has no points."""
        away = np.linalg.norm(self.places(camera, frame) - np.asarray(place), axis=1)
        return int(np.nanargmin(away)) if np.isfinite(away).any() else None


def read_measured_points(folder: Path) -> tuple[MeasuredPoints, ...]:
    """Read the result of an image correlation, one entry for each surface.

    ``folder``: the folder of a shot or of a dic.toml; `results/dic.h5` is read. Returns: the specimen and, if
    it was tracked, the flyer; or the one surface of a dic.toml. Raises InputError if it cannot be read.
    """
    path = folder / "results" / RESULT_FILE
    if find_measurement_file(folder) is None:
        return points_of(read_stereo_result(path))
    field = read_full_field(path)
    known = field.surface, tuple(field.pixels), field.points, field.cell, field.strain
    plane = field.kind == "plane"
    return (MeasuredPoints("surface", *known, unit=field.unit, plane=plane, timed=field.timed),)


def points_of(result: StereoResult) -> tuple[MeasuredPoints, ...]:
    """Specimen and, if it was tracked, flyer of a stereo result."""
    bodies = {"specimen": result.specimen, "flyer": result.flyer}
    return tuple(
        MeasuredPoints(
            name,
            body.surface,
            body.pixels,
            body.points,
            body.cell,
            result.strain if name == "specimen" else None,
        )
        for name, body in bodies.items()
        if body is not None
    )
