"""A calibration as a table of its points and as one JSON object."""

import csv
from pathlib import Path
from typing import Any

from dic.calibration import Calibration
from dic.files import text_cell


def to_json(found: Calibration) -> dict[str, Any]:
    """The calibration as one JSON object, in SI and px."""
    R, t = found.rig.relative
    return {
        "cameras": [
            {
                "matrix": camera.matrix.tolist(),
                "distortion": list(camera.distortion),
                "sensor": list(camera.sensor or ()),
            }
            for camera in found.rig.cameras
        ],
        "rotation": R.tolist(),
        "translation": t.tolist(),
        "sigma": found.sigma,
        "unit": found.unit,
        "clustering": found.clustering,
        "checks": {name: _number(value) for name, value in vars(found.checks).items()},
        "pairs": [
            {"name": pair.name, "outcome": pair.outcome.name, "reason": pair.reason, "rms": _number(pair.rms)}
            for pair in found.pairs
        ],
    }


def _number(value: float) -> float | None:
    """The number, None for NaN, which JSON does not know."""
    return value if value == value else None


def write_points(path: Path, found: Calibration) -> None:
    """Write every point of every picture as one row of a table."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(
            [
                "pair",
                "camera",
                "point",
                "x (px)",
                "y (px)",
                "sigma (px)",
                "residual x (px)",
                "residual y (px)",
                "used",
            ]
        )
        for pair in found.pairs:
            for camera, view in enumerate(pair.views):
                if view is None:
                    continue
                rows = zip(view.ids, view.pixels, view.sigma, view.residual, view.used, strict=True)
                for point, (x, y), sigma, (dx, dy), used in rows:
                    numbers = [f"{value:.5f}" for value in (x, y, sigma, dx, dy)]
                    table.writerow([text_cell(pair.name), camera, int(point), *numbers, int(used)])
