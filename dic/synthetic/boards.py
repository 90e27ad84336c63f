"""Calibration targets as paint on a board: dots with hollow fiducials, chessboard, ChArUco."""

from typing import Any

import numpy as np

from dic.arrays import FloatArray
from dic.calibration.targets import Charuco, Chessboard, FiducialDots
from dic.synthetic.paint import Paint, painted
from dic.synthetic.texture import Area, Texture

BLACK, WHITE = 0.06, 0.97
"""Reflectances of a board [-]."""
HOLE = 0.45
"""Diameter of the hole in a hollow dot over the dot's, where the target does not say it [-]."""


def board_texture(target: Any, pitch: float) -> tuple[Texture, FloatArray]:
    """Paint of a target, in the frame that its points are numbered in, and the corners of the board.

    Parameters
    ----------
    target
        A `FiducialDots`, `Chessboard` or `Charuco`.
    pitch
        Largest distance of texels [m]; x is around, y along.

    Returns
    -------
    Texture
        The paint.
    corners
        Of the board [m], shape [4, 2].

    Raises
    ------
    TypeError
        Another target.
    """
    if isinstance(target, FiducialDots):
        texture = _dots(target, pitch)
    elif isinstance(target, Chessboard):
        texture = _chessboard(target, pitch)
    elif isinstance(target, Charuco):
        texture = _charuco(target, pitch)
    else:
        raise TypeError(
            f"a target of {type(target).__name__} cannot be drawn; draw dots, chessboard or ChArUco"
        )
    rows, columns = texture.grey.shape
    x0, y0 = texture.origin
    x1, y1 = x0 + (columns - 1) * texture.pitch, y0 + (rows - 1) * texture.pitch
    return texture, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _dots(target: FiducialDots, pitch: float) -> Texture:
    p, d = target.pitch, target.diameter
    area = Area((-0.8 * p, (target.columns - 0.2) * p), (-0.8 * p, (target.rows - 0.2) * p))
    row, column = np.mgrid[: target.rows, : target.columns]
    centres = np.stack([column.ravel(), row.ravel()], axis=1) * p
    dots = painted(area, pitch, centres, np.full(len(centres), d), Paint(BLACK, WHITE, 0.0))
    hole = target.hole or HOLE * d
    middle = np.array(target.hollow, dtype=np.float64) * p
    holes = painted(area, pitch, middle, np.full(3, hole), Paint(0.0, 1.0, 0.0)).grey
    return Texture((dots.grey * holes + WHITE * (1.0 - holes)).astype(np.float32), pitch, dots.origin)


def _chessboard(target: Chessboard, pitch: float) -> Texture:
    p = target.pitch
    margin = 1.8 * p  # beyond the inner corners: a square and a bright rim
    area = Area((-margin, (target.columns - 1) * p + margin), (-margin, (target.rows - 1) * p + margin))
    x, y = area.grid(pitch)
    sign = _alternating(x, target.columns, p, pitch) * _alternating(y, target.rows, p, pitch)[:, None]
    grey = 0.5 * (WHITE + BLACK) + 0.5 * (WHITE - BLACK) * sign
    inside = _within(x, target.columns, p, pitch) * _within(y, target.rows, p, pitch)[:, None]
    return Texture((grey * inside + WHITE * (1.0 - inside)).astype(np.float32), pitch, (x[0], y[0]))


def _alternating(x: FloatArray, n: int, p: float, pitch: float) -> FloatArray:
    """1 and -1 that change sign at 0, p, ..., (n - 1) p, over a rim of 1.5 texels."""
    nearest = np.clip(np.rint(x / p), 0, n - 1)
    sign = np.where(nearest % 2 == 0, 1.0, -1.0)
    return np.asarray(sign * np.clip((x - nearest * p) / (0.75 * pitch), -1.0, 1.0))


def _within(x: FloatArray, n: int, p: float, pitch: float) -> FloatArray:
    """1 between -p and n p, 0 beyond."""
    return np.asarray(np.clip(0.5 + np.minimum(x + p, n * p - x) / (1.5 * pitch), 0.0, 1.0))


def _charuco(target: Charuco, pitch: float) -> Texture:
    """OpenCV's own drawing of the board, its squares a whole number of texels wide."""
    square = int(np.ceil(target.pitch / pitch))
    margin = square // 3
    size = (target.columns * square + 2 * margin, target.rows * square + 2 * margin)
    drawn = target._board().generateImage(size, marginSize=margin, borderBits=1)
    grey = BLACK + (WHITE - BLACK) * (drawn.astype(np.float32) / 255.0)
    texel = target.pitch / square
    first = (0.5 - margin) * texel  # middle of the first texel, from the board's corner on
    return Texture(grey, texel, (first, first))
