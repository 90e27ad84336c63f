"""Pictures of nine markers on an actuator that another program bent, and their measured positions.

Usage: python runs/actuator/markers.py LINE.csv OUT [--noise 3] [--seed 1]

LINE.csv contains the positions of the base's middle line by gravity and pressure, as in
`tests/reference/K_pneunet.csv` of DOLFINx. A camera with a distorted lens looks at nine discs on this line.
Its pictures have noise of the grey values. Synthetic pictures of a chessboard give the calibration (Zhang);
segmentation finds the markers. The script writes markers.csv for a SPEC and one picture of each state into
OUT. It prints the errors, because the true positions are known.
"""

import argparse
import csv
from pathlib import Path

import camera as cam
import cv2
import numpy as np

from kolsky.base.files import write_table
from kolsky.bodies.actuator_markers import COUNT, marker_weights

SIZE = (1280, 960)
SQUARE, DIAMETER, VIEWS = 6e-3, 2e-3, 12
"""Edge of the board's squares, diameter of the markers [m], views of the board."""
TRUE = cam.PlaneCamera(
    np.array([[1700.0, 0.0, 645.0], [0.0, 1695.0, 475.0], [0.0, 0.0, 1.0]]),
    np.array([-0.12, 0.05, 0.0005, -0.0003, 0.0]),
    np.array([np.pi + 0.03, -0.02, 0.01]),
    np.array([-0.035, -0.015, 0.16]),
)


def calibrated(noise: float, rng: np.random.Generator) -> cam.PlaneCamera:
    """The camera from a calibration with its pictures of a chessboard."""
    views = []
    for k in range(VIEWS):
        held = TRUE.rotation + np.array([0.35 * np.sin(k), 0.35 * np.cos(1.7 * k), 0.1 * k])
        R, _ = cv2.Rodrigues(held)
        middle = R @ np.append(cam.board_corners(SQUARE).mean(axis=0), 0.0)
        place = np.array([0.012 * np.cos(k), 0.008 * np.sin(k), 0.15 + 0.01 * (k % 3)]) - middle
        board = cam.PlaneCamera(TRUE.matrix, TRUE.distortion, held, place)
        views.append(cam.find_corners(cam.draw_board(board, SQUARE, size=SIZE, noise=noise, rng=rng)))
    first = (0.008, -0.002)
    flat = cam.find_corners(cam.draw_board(TRUE, SQUARE, first=first, size=SIZE, noise=noise, rng=rng))
    return cam.calibrate(views, flat, SQUARE, SIZE, first=first)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("line", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--noise", type=float, default=3.0, help="of the grey values")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    with given.line.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    states = dict.fromkeys((row["gravity"], float(row["pressure (Pa)"])) for row in rows)
    given.out.mkdir(parents=True, exist_ok=True)
    seen = calibrated(given.noise, rng)
    rest, columns, errors = None, {}, []
    for name, pressure in states:
        own = [r for r in rows if (r["gravity"], float(r["pressure (Pa)"])) == (name, pressure)]
        line = np.array([[float(r["x (m)"]), float(r["z (m)"])] for r in own])
        rest = np.array([float(r["rest x (m)"]) for r in own]) if rest is None else rest
        if pressure == 0.0:
            continue
        places = marker_weights(rest) @ line
        picture = cam.draw_markers(TRUE, places, diameter=DIAMETER, size=SIZE, noise=given.noise, rng=rng)
        cv2.imwrite(str(given.out / f"{name}_{pressure:.0f}.png"), picture)
        found = seen.in_plane(cam.find_markers(picture, COUNT, TRUE.project(np.zeros((1, 2)))[0]).pixels)
        errors.append(found - places)
        for number, (x, z) in enumerate(found, start=1):
            row = {"gravity": name, "pressure (Pa)": pressure, "marker": number}
            row |= {"x (mm)": float(1e3 * x), "z (mm)": float(1e3 * z)}
            for key, value in row.items():
                columns.setdefault(key, []).append(value)
    write_table(given.out / "markers.csv", columns)
    size = 1e6 * float(np.sqrt(np.mean(np.square(errors))))
    worst = 1e6 * float(np.abs(errors).max())
    print(
        f"calibration {seen.error:.3f} px; errors of the markers: {size:.1f} um rms, {worst:.1f} um at most"
    )


if __name__ == "__main__":
    main()
