"""Surfaces as CSV files with the variable names of VIC-3D, one file a frame."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.files import replacing, text_cell
from dic.outcome import PointOutcome
from dic.result import Body

MM = 1e3
STRAINS = ("exx", "eyy", "exy")


def write_frames(folder: Path, body: Body, *, strain: FloatArray | None = None) -> list[Path]:
    """Write the points of a body frame by frame.

    The columns are those of a VIC-3D export: reference position X, Y, Z and displacement U, V, W [mm] (X
    across, Y along the axis toward the flyer, Z toward the cameras), the place x, y in the picture of camera
    0 [px], Sigma, the larger of both cameras' standard deviations of a place [px], sigma_X, sigma_Y, sigma_Z
    [mm], the epipolar distance e [px], and exx, eyy, exy, the Green-Lagrange strain, if it is given. A column
    more names the outcome; a point that was lost has its row, its numbers are empty.

    Parameters
    ----------
    folder
        Where to; made if absent. The files are ``frame_0000.csv`` and so on.
    body
        The points.
    strain
        Strain of every point, NaN where it has none [-], shape [n_frames, n_points, 3].

    Raises
    ------
    ValueError
        A strain of another shape.
    OSError
        If a file cannot be written; an older one is then unchanged.
    """
    surface = body.surface
    shape = (surface.n_frames, surface.n_points, 3)
    if strain is not None and strain.shape != shape:
        raise ValueError(f"strain has shape {strain.shape}, must be {shape}")
    folder.mkdir(parents=True, exist_ok=True)
    names = ["X", "Y", "Z", "U", "V", "W", "x", "y", "Sigma", "sigma_X", "sigma_Y", "sigma_Z", "e"]
    names += list(STRAINS) if strain is not None else []
    ending = {int(member): member.name for member in PointOutcome}
    written = []
    for frame in range(surface.n_frames):
        columns = [
            MM * surface.X,
            MM * surface.u[frame],
            body.pixels[0][frame],
            np.fmax(body.match_sigma[0][frame], body.match_sigma[1][frame])[:, None],
            MM * surface.sigma[frame],
            body.epipolar[frame][:, None],
        ]
        table = np.hstack([*columns, *([strain[frame]] if strain is not None else [])])
        path = folder / f"frame_{frame:04d}.csv"
        with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*names, "outcome"])
            for row, outcome in zip(table, surface.outcome[frame], strict=True):
                numbers = [f"{value:.7g}" if np.isfinite(value) else "" for value in row]
                writer.writerow([*numbers, ending[int(outcome)]])
        written.append(path)
    return written


def write_history(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write columns of equal length, named with their units, as one table; NaN is an empty cell.

    Raises
    ------
    ValueError
        Columns of different length.
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"columns have different lengths: {lengths}")
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([text_cell(name) for name in columns])
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            writer.writerow([_cell(value) for value in row])


def _cell(value: float | int | str) -> float | int | str:
    if isinstance(value, str):
        return text_cell(value)
    if not isinstance(value, float):
        return value
    return "" if np.isnan(value) else f"{value:.9g}"
