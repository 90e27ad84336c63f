"""A bending actuator of chambers in a row (Pneunet), as hexahedra or tetrahedra of a rectangular grid.

The actuator lies along x with the middle of its clamped end's lower edge in the origin; its base is the side
z = 0, and the chambers stand on it. A channel along the base joins them and goes on through the inlet to the
clamped end. Inside a row along x the parts are

    inlet, wall, chamber, wall, gap, wall, chamber, wall, gap, ... , wall, chamber, wall,

along z the base, the channel, the rest of the chamber and its roof. Between neighbouring chambers the gap is
open above the channel's roof. Every part is cut into the whole number of cells that makes them nearest to the
wanted size, walls into at least `through_wall`. Without gravity across it the actuator is its own mirror
image in the plane y = 0, and half of it is enough.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from implicit.meshes import Mesh, grid
from kolsky.base.arrays import BoolArray, FloatArray, IntArray

SOLID, CHANNEL, OUTSIDE = 0, -1, -2
"""Kinds of cells of the grid; chambers are 1, 2, ..."""
TIGHT = 1e-9
"""Distance from a plane within which a point lies on it, as a share of the length [-]."""


@dataclass(frozen=True)
class Pneunet:
    """Dimensions of an actuator and the fineness of its mesh."""

    chambers: int = 6
    """Number of chambers."""
    wall: float = 2.5e-3
    """Thickness of every wall and of the roofs [m]."""
    base: float = 2.5e-3
    """Thickness of the base below the channel [m]."""
    chamber: tuple[float, float, float] = (3.0e-3, 10.0e-3, 10.0e-3)
    """Inner length (along x), width (y) and height (z) of a chamber [m]."""
    gap: float = 2.0e-3
    """Distance between the walls of neighbouring chambers [m]."""
    channel: tuple[float, float] = (2.0e-3, 2.0e-3)
    """Width and height of the channel that joins the chambers [m]; it is the inlet's bore too."""
    inlet: float = 5.0e-3
    """Length of the clamped inlet block [m]."""
    cell: float = 4.0e-3
    """Wanted size of the cells [m]."""
    through_wall: int = 1
    """Fewest cells through a wall."""
    element: str = "hex27"
    """hex27, hex8, tet10 or tet4."""
    half: bool = True
    """Half of it, with the plane y = 0 as a mirror."""
    separate: bool = False
    """Chambers that nothing joins, each with a pressure of its own."""

    def __post_init__(self) -> None:
        if self.chambers < 1 or self.through_wall < 1:
            raise ValueError("chambers and through_wall must be >= 1")
        named = {
            "wall": self.wall, "base": self.base, "gap": self.gap, "inlet": self.inlet, "cell": self.cell,
            "chamber": min(self.chamber), "channel": min(self.channel),
        }  # fmt: skip
        for name, value in named.items():
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be > 0 m, got {value}")
        for what, inner, outer in (
            ("width", self.channel[0], self.chamber[1]),
            ("height", self.channel[1] + self.wall, self.chamber[2]),
        ):
            if not inner < outer:
                raise ValueError(
                    f"the channel's {what} (with its roof) must be below the chamber's, "
                    f"got {inner:g} and {outer:g} m"
                )
        if self.element not in ("hex27", "hex8", "tet10", "tet4"):
            raise ValueError(f"element must be hex27, hex8, tet10 or tet4, got {self.element!r}")

    @property
    def length(self) -> float:
        """Whole length [m]."""
        each = 2.0 * self.wall + self.chamber[0]
        return self.inlet + self.chambers * each + (self.chambers - 1) * self.gap

    @property
    def width(self) -> float:
        """Outer width [m]."""
        return self.chamber[1] + 2.0 * self.wall

    @property
    def height(self) -> float:
        """Outer height [m]."""
        return self.base + self.chamber[2] + self.wall

    @cached_property
    def _grid(self) -> tuple[tuple[FloatArray, ...], IntArray]:
        parts: list[tuple[float, int]] = [(self.inlet, CHANNEL)]
        for number in range(1, self.chambers + 1):
            parts += [(self.wall, CHANNEL), (self.chamber[0], number)]
            parts += [(self.wall, CHANNEL), (self.gap, OUTSIDE)]
        parts = [*parts[:-2], (self.wall, SOLID)]  # the last chamber ends in a whole wall
        x, of_x = self._cut([length for length, _ in parts])
        kinds = np.array([kind for _, kind in parts])[of_x]
        bore, hollow = 0.5 * self.channel[0], 0.5 * self.chamber[1]
        y, of_y = self._cut([bore, hollow - bore, self.wall])
        if not self.half:
            y, of_y = np.concatenate([-y[:0:-1], y]), np.concatenate([of_y[::-1], of_y])
        roof = self.chamber[2] - self.channel[1] - self.wall
        z, of_z = self._cut([self.base, self.channel[1], self.wall, roof, self.wall])
        kx, ky, kz = np.meshgrid(kinds, of_y, of_z, indexing="ij")
        cells = np.full(kx.shape, SOLID)
        cells[(kx == OUTSIDE) & (kz > 2)] = OUTSIDE
        if not self.separate:
            cells[((kx == CHANNEL) | (kx == OUTSIDE)) & (ky == 0) & (kz == 1)] = CHANNEL
        inside = (kx > 0) & (ky < 2) & (kz >= 1) & (kz < 4)
        cells[inside] = kx[inside]
        return (x, y, z), cells

    def _cut(self, lengths: list[float]) -> tuple[FloatArray, IntArray]:
        """Lines of parts in a row [m], and the part of each cell."""
        counts = []
        for length in lengths:
            least = self.through_wall if length in (self.wall, self.base) else 1
            counts.append(max(least, round(length / self.cell)))
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        lines = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True)]
        return np.concatenate([[0.0], *lines]), np.repeat(np.arange(len(lengths)), counts)

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh with its sets.

        Sets: "clamp" (x = 0), "mirror" (y = 0, of a half), "cavity" or, of separate chambers, "cavity_1" and
        so on, "origin" and "tip" (ends of the base's middle line), "line" (all of it), and of each gap
        "gap_1_left", "gap_1_right": the walls that face each other.
        """
        lines, cells = self._grid
        solid: BoolArray = cells == SOLID
        mesh = grid(lines, solid, kind=self.element)
        tight = TIGHT * self.length
        p = mesh.points
        sets: dict[str, IntArray] = {
            "clamp": np.flatnonzero(p[:, 0] < tight),
            "line": np.flatnonzero((np.abs(p[:, 1]) < tight) & (p[:, 2] < tight)),
        }
        if self.half:
            sets["mirror"] = np.flatnonzero(p[:, 1] < tight)
        sets["line"] = sets["line"][np.argsort(p[sets["line"], 0], kind="stable")]
        sets["origin"], sets["tip"] = sets["line"][:1], sets["line"][-1:]
        hollows = [("cavity", (cells > 0) | (cells == CHANNEL))]
        if self.separate:
            hollows = [(f"cavity_{n}", cells == n) for n in range(1, self.chambers + 1)]
        for name, hollow in hollows:
            sets[name] = _touching(p, lines, hollow, tight)
        pitch = (self.length - self.inlet + self.gap) / self.chambers
        rows = self.inlet + np.arange(1, self.chambers) * pitch
        above = p[:, 2] > self.base + self.channel[1] + self.wall - tight
        for number, end in enumerate(rows, start=1):
            for side, at in (("left", end - self.gap), ("right", end)):
                sets[f"gap_{number}_{side}"] = np.flatnonzero(above & (np.abs(p[:, 0] - at) < tight))
        return Mesh(p, mesh.cells, mesh.kind, sets)

    @property
    def cavities(self) -> tuple[str, ...]:
        """Sets of the pressurised walls."""
        return tuple(f"cavity_{n}" for n in range(1, self.chambers + 1)) if self.separate else ("cavity",)


def _touching(points: FloatArray, lines: tuple[FloatArray, ...], hollow: BoolArray, tight: float) -> IntArray:
    """Points that lie in or on the hollow cells."""
    found = np.zeros(len(points), dtype=bool)
    # a point on a line belongs to the cells on both sides of it
    sides = []
    for axis, line in enumerate(lines):
        low = np.clip(np.searchsorted(line, points[:, axis] - tight, side="right") - 1, 0, len(line) - 2)
        high = np.clip(np.searchsorted(line, points[:, axis] + tight, side="right") - 1, 0, len(line) - 2)
        sides.append((low, high))
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):
                found |= hollow[sides[0][i], sides[1][j], sides[2][k]]
    return np.flatnonzero(found)
