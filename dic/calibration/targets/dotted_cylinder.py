"""Cylinder with rings of dots."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.calibration.dots import find_dots
from dic.calibration.targets.base import Detection, Geometry, TargetNotFound, counts, grow, positive

Anchor = tuple[int, int, float, float]

STEEPEST = 0.45
"""Smallest apparent width of used columns, relative to the middle. These dots are seen at less than 63°."""


@dataclass(frozen=True, kw_only=True)
class DottedCylinder:
    """Rings of dots round a cylinder: rows along its axis, columns round it.

    Dot (column, row) has number ``row * columns + column``. With φ = column pitch / radius it lies at (radius
    cos φ, radius sin φ, row pitch). Rows count along the axis. Columns count counterclockwise, seen against
    the direction of the axis. The target has no marks that identify dots, so three dots in each camera's
    picture are declared by hand.
    """

    columns: int
    """Columns of dots."""
    rows: int
    """Rings of dots."""
    radius: float
    """Radius of the cylinder [m]."""
    pitch: float
    """Distance between rings along the axis [m]."""
    arc: float
    """Distance between columns along the surface [m]."""
    size: float
    """Diameter of round dots, side of square ones [m]."""
    square: bool = False
    """Square dots; False: round."""
    dark: bool = True
    """Black dots on white; False: white on black."""
    anchors: tuple[Anchor, ...] = ()
    """Three dots as (column, row, x, y) with their positions in the picture [px], accurate to half the
    distance between dots; they identify all others. Not needed for `geometry`."""

    def __post_init__(self) -> None:
        counts(3, columns=self.columns, rows=self.rows)
        positive(radius=self.radius, pitch=self.pitch, arc=self.arc, size=self.size)
        if (self.columns - 1) * self.arc >= 2.0 * np.pi * self.radius:
            raise ValueError(
                f"{self.columns} columns {self.arc} m apart do not fit round a cylinder of radius "
                f"{self.radius} m"
            )
        for column, row, *_ in self.anchors:
            if not (0 <= column < self.columns and 0 <= row < self.rows):
                raise ValueError(
                    f"anchor ({column}, {row}) must lie in columns 0 to {self.columns - 1} and rows 0 to "
                    f"{self.rows - 1}"
                )
        if self.anchors:
            index = np.array([(a[0], a[1], 1.0) for a in self.anchors])
            if index.shape != (3, 3) or np.linalg.det(index) == 0.0:
                raise ValueError(f"anchors must be three dots that are not on a line, got {self.anchors}")

    def geometry(self) -> Geometry:
        """Its dots, on the surface; their curvature bends their centroids."""
        row, column = np.mgrid[: self.rows, : self.columns]
        row, column = row.ravel(), column.ravel()
        angle = column * self.arc / self.radius
        normals = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=1)
        spread = self.size**2 / (12.0 if self.square else 16.0)
        points = self.radius * normals
        around = np.stack([-np.sin(angle), np.cos(angle), np.zeros(len(angle))], axis=1)
        points[:, 2] = row * self.pitch
        n = len(points)
        return Geometry(
            points, normals, np.full(n, spread), around / np.sqrt(self.radius), np.arange(n)[None]
        )

    def detect(self, picture: NDArray[np.generic]) -> Detection:
        """Its dots in a picture, without those near the cylinder's visible edge.

        Raises TargetNotFound if there is no dot at an anchor, or fewer than twelve dots form a lattice with
        the anchors.
        """
        if not self.anchors:
            raise TargetNotFound(
                "a dotted cylinder needs anchors: three of its dots as (column, row, x, y) in each camera"
            )
        dots = find_dots(picture, dark=self.dark, round_dots=not self.square)
        seeds = {}
        for column, row, x, y in self.anchors:
            distance = np.hypot(*(dots.centre - [x, y]).T) if len(dots.radius) else np.array([np.inf])
            near = int(np.argmin(distance))
            if not distance[near] < 3.0 * dots.radius[near]:
                raise TargetNotFound(
                    f"no dot at the anchor ({column}, {row}), pixel ({x:g}, {y:g}): the nearest lies "
                    f"{distance[near]:.0f} px away"
                )
            seeds[near] = (column, row)
        if len(seeds) != 3:
            raise TargetNotFound("two anchors fall on one dot; give each a different place")
        index = np.array([(*place, 1.0) for place in seeds.values()])
        steps = np.linalg.solve(index, dots.centre[list(seeds)])[:2]
        places = grow(dots.centre, seeds, steps)
        lattice = {
            place: number
            for place, number in places.items()
            if 0 <= place[0] < self.columns and 0 <= place[1] < self.rows
        }
        lattice = _facing(lattice, dots.centre)
        if len(lattice) < 12:
            raise TargetNotFound(f"{len(lattice)} dots form a lattice with the anchors, 12 are needed")
        ids = np.array([row * self.columns + column for column, row in lattice])
        numbers = np.array(list(lattice.values()))[np.argsort(ids)]
        return Detection(np.sort(ids).astype(np.int64), dots.centre[numbers], dots.sigma[numbers])


def _facing(places: dict[tuple[int, int], int], centre: FloatArray) -> dict[tuple[int, int], int]:
    """Dots with two neighbours in their ring at a distance close to the largest of all rings."""
    widths = {}
    for (column, row), number in places.items():
        neighbours = [places.get((column + sign, row)) for sign in (-1, 1)]
        steps = [float(np.hypot(*(centre[k] - centre[number]))) for k in neighbours if k is not None]
        if steps:
            widths[column, row] = float(np.mean(steps))
    if not widths:
        return {}
    widest = float(np.percentile(list(widths.values()), 95.0))
    return {place: number for place, number in places.items() if widths.get(place, 0.0) > STEEPEST * widest}
