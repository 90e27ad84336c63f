"""Symmetric dot grid with three hollow dots that identify all dots."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from dic.calibration.dots import Dots, find_dots
from dic.calibration.targets.base import (
    Detection,
    Geometry,
    TargetNotFound,
    counts,
    grow,
    homography_outliers,
    positive,
)

Place = tuple[int, int]

MOST_HOLLOW = 12
"""Largest number of hollow dots in a picture for which triples are searched."""


@dataclass(frozen=True, kw_only=True)
class FiducialDots:
    """Rows and columns of dots, three of them hollow in the shape of an L.

    Dot (column, row) lies at (column, row) times the pitch; its number is ``row * columns + column``. Rows
    may count up or down on the board, as long as `hollow` counts in the same way. Dots of a larger board
    beyond the first or last column and row are not used.

    Raises ValueError if a size is not positive, if dots touch, or if the hollow dots are no L with arms of
    two lengths.
    """

    columns: int
    """Dots in a row."""
    rows: int
    """Dots in a column."""
    pitch: float
    """Distance between neighbours [m]."""
    diameter: float
    """Diameter of a dot [m]."""
    hollow: tuple[Place, Place, Place]
    """(column, row) of the hollow dots, from 0: corner of the L and ends of its arms, in any order."""
    hole: float = 0.0
    """Diameter of the hole in a hollow dot [m]; 0: not known, taken as 0.45 of the dot's."""
    dark: bool = True
    """Black dots on white; False: white on black."""

    def __post_init__(self) -> None:
        counts(3, columns=self.columns, rows=self.rows)
        positive(pitch=self.pitch, diameter=self.diameter)
        if not self.diameter < self.pitch:
            raise ValueError(f"diameter must be below the pitch {self.pitch} m, got {self.diameter} m")
        if not 0.0 <= self.hole < self.diameter:
            raise ValueError(f"hole must be from 0 to below the diameter {self.diameter} m, got {self.hole}")
        if len({tuple(place) for place in self.hollow}) != 3:
            raise ValueError(f"hollow must be three different (column, row), got {self.hollow}")
        for column, row in self.hollow:
            if not (0 <= column < self.columns and 0 <= row < self.rows):
                raise ValueError(
                    f"hollow dot ({column}, {row}) must lie in columns 0 to {self.columns - 1} and rows 0 to "
                    f"{self.rows - 1}"
                )
        corner, along, up = self.ell()
        if along[0] == corner[0] or up[1] == corner[1]:
            raise ValueError(f"hollow dots must form an L along a row and a column, got {self.hollow}")
        if abs(along[0] - corner[0]) == abs(up[1] - corner[1]):
            raise ValueError(
                f"the arms of the L must differ in length, or it looks the same from two sides: {self.hollow}"
            )

    def ell(self) -> tuple[Place, Place, Place]:
        """The hollow dots as corner, end of the arm along its row, end of the arm along its column."""
        for corner, along, up in permutations(self.hollow):
            if along[1] == corner[1] and up[0] == corner[0]:
                return corner, along, up
        raise ValueError(f"hollow dots must form an L along a row and a column, got {self.hollow}")

    def geometry(self) -> Geometry:
        """Its points; a hollow dot's centroid is taken over a ring of the nominal hole."""
        row, column = np.mgrid[: self.rows, : self.columns]
        n = self.rows * self.columns
        points = np.stack([column.ravel(), row.ravel(), np.zeros(n)], axis=1) * self.pitch
        spread = np.full(n, self.diameter**2 / 16.0)  # r²/4
        for place in self.hollow:  # (r⁴ - s⁴) / (4 (r² - s²)) of a ring
            spread[place[1] * self.columns + place[0]] += (self.hole or 0.45 * self.diameter) ** 2 / 16.0
        normals = np.tile([0.0, 0.0, 1.0], (n, 1))
        return Geometry(points, normals, spread, np.zeros((n, 3)), np.arange(n)[None])

    def detect(self, picture: NDArray[np.generic]) -> Detection:
        """Its dots in a picture; dots that touch the picture's edge are left out.

        Raises TargetNotFound if there are no three hollow dots in the right places of a lattice of dots.
        """
        dots = find_dots(picture, dark=self.dark)
        candidates = np.flatnonzero(dots.hollow)
        if not 3 <= len(candidates) <= MOST_HOLLOW:
            raise TargetNotFound(
                f"{len(candidates)} hollow among {len(dots.radius)} dots, 3 are needed; are all three in "
                "view, in focus and free of glare?"
            )
        best: dict[Place, int] = {}
        for triple in permutations(candidates.tolist(), 3):
            best = max(best, self._places(dots, triple), key=len)
            if len(best) == self.columns * self.rows:  # no other can have more
                break
        least = max(8, self.columns * self.rows // 5)
        if len(best) < least:
            raise TargetNotFound(
                f"{len(best)} dots of {self.columns} x {self.rows} fit a lattice with its hollow dots, "
                f"{least} are needed; check columns, rows and hollow"
            )
        places = np.array(list(best))
        numbers = np.array([best[place] for place in best])
        ids = places[:, 1] * self.columns + places[:, 0]
        order = np.argsort(ids)
        numbers = numbers[order]
        return Detection(ids[order].astype(np.int64), dots.centre[numbers], dots.sigma[numbers])

    def _places(self, dots: Dots, triple: tuple[int, int, int]) -> dict[Place, int]:
        """Lattice places of dots if the triple is corner, row's end and column's end; empty if it is not."""
        corner, along, up = self.ell()
        p, q, r = dots.centre[list(triple)]
        steps = np.array([(q - p) / (along[0] - corner[0]), (r - p) / (up[1] - corner[1])])
        # In a useful picture the arms of the L cannot be very unequal or nearly parallel.
        across = abs(steps[0, 0] * steps[1, 1] - steps[0, 1] * steps[1, 0])
        lengths = np.hypot(*steps.T)
        if across < 0.2 * lengths[0] * lengths[1] or not 0.25 < lengths[0] / lengths[1] < 4.0:
            return {}
        if lengths.min() < 2.0 * np.median(dots.radius):
            return {}
        seeds = dict(zip(triple, (corner, along, up), strict=True))
        places = grow(dots.centre, seeds, steps)
        hollow = set(self.hollow)
        if any(dots.hollow[number] and place not in hollow for place, number in places.items()):
            return {}
        index = np.array(list(places), dtype=np.float64)
        off = homography_outliers(index, dots.centre[list(places.values())], 0.15)
        return {
            place: number
            for (place, number), bad in zip(places.items(), off, strict=True)
            if not bad and 0 <= place[0] < self.columns and 0 <= place[1] < self.rows
        }
