"""Pictures of calibration targets by ray casting with OpenCV's lens model: shares no code with `dic`."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np

MATRIX = np.array([[1500.0, 0.0, 160.7], [0.0, 1490.0, 118.2], [0.0, 0.0, 1.0]])
LENS = np.array([-0.15, 0.3, 1e-3, -5e-4, 0.0])
SHAPE = (240, 320)
FINE = 4  # number of rays of a pixel in each direction

Paint = Callable[[np.ndarray], np.ndarray]


@cache
def rays() -> np.ndarray:
    """Directions (x, y, 1) of all rays, shape [rows * FINE * columns * FINE, 3].

    Between pixel centres the directions are interpolated linearly. The lens causes a deviation of at most
    1e-8.
    """
    focal = MATRIX[[0, 1], [0, 1]]
    rows, columns = SHAPE
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).astype(float)
    ideal = (grid - MATRIX[:2, 2]) / focal
    for _ in range(6):  # each step shortens the error by the distortion's slope, 0.03 at most here
        ahead = np.concatenate([ideal, np.ones((rows, columns, 1))], axis=-1).reshape(-1, 3)
        seen = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), MATRIX, LENS)[0]
        ideal = ideal - (seen.reshape(grid.shape) - grid) / focal
    down, right = np.gradient(ideal, axis=(0, 1))
    sub = (np.arange(FINE) + 0.5) / FINE - 0.5
    fine = ideal[:, None, :, None] + sub[:, None, None, None] * down[:, None, :, None]
    fine = fine + sub[:, None] * right[:, None, :, None]
    return np.concatenate([fine.reshape(-1, 2), np.ones((fine.size // 2, 1))], axis=1)


def averaged(bright: np.ndarray, *, noise: float = 0.0, seed: int = 1, blur: float = 0.6) -> np.ndarray:
    """An 8-bit picture of brightness 0 to 1 along the rays, blurred, with noise [grey levels]."""
    rows, columns = SHAPE
    picture = bright.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3))
    picture = cv2.GaussianBlur(20.0 + 190.0 * picture, (0, 0), blur)
    picture = picture + noise * np.random.default_rng(seed).standard_normal(picture.shape)
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)


def flat(paint: Paint, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Brightness of a painted plane z = 0 in front of a dark background, one value per ray."""
    d = rays()
    here, into = -R.T @ t, d @ R  # the camera, and the directions, in the target's frame
    X = here + into * (-here[2] / into[:, 2])[:, None]
    return paint(X[:, :2])


def cylinder(paint: Paint, radius: float, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Brightness of a painted cylinder about z. `paint` is a function of (angle, z). Rays that miss it are
    dark."""
    d = rays()
    here, into = -R.T @ t, d @ R
    a = into[:, 0] ** 2 + into[:, 1] ** 2
    b = into[:, 0] * here[0] + into[:, 1] * here[1]
    c = here[0] ** 2 + here[1] ** 2 - radius**2
    root = b * b - a * c
    hit = root > 0.0
    X = here + into * ((-b - np.sqrt(np.where(hit, root, 0.0))) / a)[:, None]
    return np.where(hit, paint(np.stack([np.arctan2(X[:, 1], X[:, 0]), X[:, 2]], axis=1)), 0.0)


def dots(
    columns: int,
    rows: int,
    pitch: float,
    diameter: float,
    hollow: tuple = (),
    hole: float = 0.0,
    margin: float = 0.8,
) -> Paint:
    """Dark dots on a bright board. Its edge is `margin` pitches beyond the dots."""

    def paint(X: np.ndarray) -> np.ndarray:
        place = X / pitch
        nearest = np.round(place)
        r = np.hypot(*((place - nearest) * pitch).T)
        on = np.all((nearest >= 0) & (nearest < [columns, rows]), axis=1)
        dark = on & (r < 0.5 * diameter)
        for spot in hollow:
            dark &= ~(np.all(nearest == spot, axis=1) & (r < 0.5 * hole))
        board = np.all((place > -margin) & (place < [columns - 1 + margin, rows - 1 + margin]), axis=1)
        return board * np.where(dark, 0.0, 1.0)

    return paint


def pose(turn: tuple[float, float, float], middle: tuple[float, float], depth: float) -> tuple:
    """R and t of a target whose point `middle` is on the optical axis at `depth` [m]."""
    R = cv2.Rodrigues(np.array(turn))[0]
    return R, np.array([0.0, 0.0, depth]) - R @ [*middle, 0.0]


def pixels(points: np.ndarray, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """OpenCV's projection of points of the target, shape [n, 2]."""
    return cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, MATRIX, LENS)[0][:, 0]


HOLLOW = ((2, 2), (7, 2), (2, 5))
MIDDLE = (5.4e-3, 4.2e-3)
TURN = cv2.Rodrigues(np.array([0.0, 0.2, 0.0]))[0]
SHIFT = np.array([0.0, 0.0, 0.1]) - TURN @ [0.0, 0.0, 0.1] + [1e-4, 2e-4, 0.0]

CALIBRATION = """
[calibration]
camera_0 = "left_*.png"
camera_1 = "right_*.png"
distortion = "k1 k2 p1 p2"

[calibration.target]
kind = "fiducial_dots"
columns = 10
rows = 8
pitch = "1.2 mm"
diameter = "0.6 mm"
hole = "0.28 mm"
hollow = [[2, 2], [7, 2], [2, 5]]
"""


def board_series(folder: Path) -> Path:
    """Seven pairs of a board with calibration.toml. The fourth and the sixth picture of camera 1 are
    swapped."""
    paint = dots(10, 8, 1.2e-3, 0.6e-3, HOLLOW, 0.28e-3)
    rng = np.random.default_rng(5)
    second = []
    for k in range(7):
        R, t = pose(tuple(rng.uniform(-0.45, 0.45, 3)), MIDDLE, 0.1 + rng.uniform(-4e-3, 4e-3))
        cv2.imwrite(str(folder / f"left_{k}.png"), averaged(flat(paint, R, t), noise=1.5, seed=k))
        second.append(averaged(flat(paint, TURN @ R, TURN @ t + SHIFT), noise=1.5, seed=50 + k))
    second[3], second[5] = second[5], second[3]
    for k, picture in enumerate(second):
        cv2.imwrite(str(folder / f"right_{k}.png"), picture)
    (folder / "calibration.toml").write_text(CALIBRATION, encoding="utf-8")
    return folder
