"""Results as tables: CSV files with VIC-3D's variable names, pandas, and the reporting table.

The reporting table has the entries required by the iDICs Good Practices Guide (Jones and Iadicola (eds.), 2nd
edition): hardware, pattern, analysis and noise floors.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.files import replacing, text_cell
from dic.outcome import FrameOutcome, PointOutcome
from dic.result import Body, FullField, StereoResult
from dic.surfaces.strains import StrainOutcome
from dic.surfaces.surface_history import SurfaceHistory

NOT_STATED = "not stated"
STATED = ("camera", "lens", "aperture", "exposure", "lighting", "pattern")
"""Facts that no file contains. The user may state them in words."""


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    part: str
    """"hardware", "pattern", "analysis" or "noise floor"."""
    name: str
    value: str
    """Number with unit, words, or `NOT_STATED`."""


def reporting_table(result: StereoResult) -> tuple[Row, ...]:
    """The reporting table of a result, in the order of the guide."""
    parts = {
        "hardware": _hardware(result, result.facts),
        "pattern": _pattern(result, result.facts),
        "analysis": _analysis(result, result.facts),
        "noise floor": _noise(result),
    }
    return tuple(Row(part, name, value) for part, rows in parts.items() for name, value in rows.items())


def geometry(result: StereoResult) -> dict[str, float]:
    """Geometry of the cameras about the specimen.

    Returns: "scale_x", "scale_y": pixels of camera 0 per metre across and along the specimen; "stereo_angle"
    [rad]; "distance" of camera 0 from the surface [m].
    """
    first, second = result.rig.cameras
    frame = result.placement.frame
    middle = result.specimen.surface.X.mean(axis=0)
    at = frame.origin + frame.rotation.T @ middle
    small = 1e-5
    projected = first.project(np.stack([at, *(at + small * frame.rotation[axis] for axis in (0, 1))]))
    scale = np.linalg.norm(projected[1:] - projected[0], axis=1) / small
    views = [(at - camera.centre) / np.linalg.norm(at - camera.centre) for camera in (first, second)]
    return {
        "scale_x": float(scale[0]),
        "scale_y": float(scale[1]),
        "stereo_angle": float(np.arccos(np.clip(views[0] @ views[1], -1.0, 1.0))),
        "distance": float(np.linalg.norm(at - first.centre)),
    }


def _hardware(result: StereoResult, facts: Mapping[str, Any]) -> dict[str, str]:
    stated = {name: facts.get("reporting", {}).get(name) or NOT_STATED for name in STATED}
    pictures, geometry_facts = facts["pictures"], geometry(result)
    rows, columns = pictures["shape"]
    per_mm = (1e-3 * geometry_facts["scale_x"], 1e-3 * geometry_facts["scale_y"])
    sensors = [camera.sensor for camera in result.rig.cameras]
    sensor = "; ".join(f"{s[0]} x {s[1]} px" for s in sensors if s is not None)
    rate = 1.0 / np.median(np.diff(result.t))
    crops = "; ".join(f"({x:g}, {y:g})" for x, y in pictures["crop_offset"])
    return {
        "camera": stated["camera"],
        "sensor": sensor or NOT_STATED,
        "image resolution": f"{columns} x {rows} px at {crops} px of the sensors, {pictures['bits']} bits",
        "lens": stated["lens"],
        "aperture": stated["aperture"],
        "exposure": stated["exposure"],
        "lighting": stated["lighting"],
        "field of view": f"{columns / per_mm[0]:.3g} x {rows / per_mm[1]:.3g} mm",
        "image scale": f"{per_mm[0]:.4g} px/mm across, {per_mm[1]:.4g} px/mm along the axis",
        "stereo angle": f"{np.degrees(geometry_facts['stereo_angle']):.4g} degrees",
        "stand-off distance": f"{1e3 * geometry_facts['distance']:.4g} mm",
        "image acquisition rate": f"{rate:.6g} frames/s, {len(result.t)} frames",
        "patterning technique": stated["pattern"],
    }


def _pattern(result: StereoResult, facts: Mapping[str, Any]) -> dict[str, str]:
    """The speckle report, camera by camera."""
    geometry_facts = geometry(result)
    per_mm = 1e-3 * float(np.sqrt(geometry_facts["scale_x"] * geometry_facts["scale_y"]))
    subset, rows = facts["settings"]["subset"], {}
    for camera, speckle in enumerate(facts.get("speckle", ())):
        if "problem" in speckle:
            rows[f"camera {camera}"] = f"{NOT_STATED}: {speckle['problem']}"
            continue
        (x, y), edges = speckle["size"], speckle["size_by_edges"]
        entries = {
            "feature size": f"{x:.3g} x {y:.3g} px by autocorrelation, {edges:.3g} px by edges; "
            f"{0.5 * (x + y) / per_mm:.3g} mm",
            "coverage": f"{100.0 * speckle['coverage']:.3g} % dark",
            "mean intensity gradient": f"{speckle['mean_gradient']:.4g} grey/px",
            "grey noise": f"{speckle['noise']:.3g} grey",
        }
        if speckle["floor"] is not None:
            floor, needed = f"{speckle['floor']:.2g} px", speckle["needed"]
            entries["predicted noise floor"] = f"{floor}, median over subsets of {subset} px"
            enough = "no subset tried" if needed is None else f"one of {needed} px"
            entries["subset too small"] = (
                f"at {100.0 * speckle['too_small']:.2g} % of the places for {speckle['wanted']:g} px; "
                f"{enough} would be enough at 95 %"
            )
        rows |= {f"{name}, camera {camera}": value for name, value in entries.items()}
    return rows or {"feature size": NOT_STATED}


def _analysis(result: StereoResult, facts: Mapping[str, Any]) -> dict[str, str]:
    settings = facts["settings"]
    subset, step, window = settings["subset"], settings["step"], settings["strain_window"]
    gauge = result.strain.gauge
    per_mm = 1e-3 * geometry(result)["scale_x"]
    prefilter = settings["prefilter"]
    return {
        "software": str(facts.get("software", NOT_STATED)),
        "image filtering": f"Gaussian, standard deviation {prefilter:g} px" if prefilter > 0.0 else "none",
        "subset size": f"{subset} px, {subset / per_mm:.3g} mm",
        "step size": f"{step} px, {step / per_mm:.3g} mm",
        "subset shape function": f"{settings['shape']} in time, {settings['stereo_shape']} between "
        "the cameras",
        "matching criterion": str(settings["criterion"]),
        "interpolant": str(settings["interpolant"]),
        "reference": str(settings["reference"]),
        "strain window": f"{window} x {window} points",
        "virtual strain gauge": f"{gauge:g} px, {gauge / per_mm:.3g} mm",
        "strain formulation": "Green-Lagrange, from linear fits of the places at rest and now over "
        "the window",
        "post-processing filter": "none",
        "calibration": str(facts.get("calibration", NOT_STATED)),
        "epipolar distance, rms": f"{result.specimen.epipolar_rms:.3g} px",
    }


def _noise(result: StereoResult) -> dict[str, str]:
    noise = result.noise
    axes = ("x, across", "y, along the axis", "Z, out of plane")
    each = zip(axes, 1e6 * noise.time, 1e6 * noise.space, 1e6 * noise.sigma, strict=True)
    rows = {
        f"displacement {axis}": f"{time:.3g} µm in time, {space:.3g} µm in space (predicted {sigma:.3g} µm)"
        for axis, time, space, sigma in each
    }
    for name, value in zip(("around the axis", "along the axis", "shear"), result.strain_noise, strict=True):
        text = NOT_STATED if not np.isfinite(value) else f"{1e6 * value:.3g} µm/m in time"
        rows[f"strain {name}"] = text
    return rows | {"taken from": f"{noise.n_frames} static frames, {noise.n_points} points valid in all"}


def as_csv(rows: tuple[Row, ...]) -> str:
    """The table as CSV. Text that begins like a formula is guarded (`dic.files.text_cell`)."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["part", "quantity", "value"])
    writer.writerows([text_cell(text) for text in (row.part, row.name, row.value)] for row in rows)
    return text.getvalue()


def as_markdown(rows: tuple[Row, ...]) -> str:
    """The table as Markdown."""
    lines = ["| part | quantity | value |", "| --- | --- | --- |"]
    for row in rows:
        cells = (
            str(text).replace("\\", "\\\\").replace("|", "\\|").replace("\n", " ")
            for text in vars(row).values()
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


MM = 1e3
STRAINS = ("exx", "eyy", "exy")


def write_frames(folder: Path, body: Body, *, strain: FloatArray | None = None) -> list[Path]:
    """Write the points of a body, one file per frame.

    The columns are those of a VIC-3D export. X, Y, Z are the reference position and U, V, W the displacement
    [mm]. X is across, Y is along the axis toward the flyer, Z is toward the cameras. x, y is the position in
    the picture of camera 0 [px]. Sigma is the larger of both cameras' standard deviations of a position [px].
    Then follow sigma_X, sigma_Y, sigma_Z [mm] and the epipolar distance e [px]. exx, eyy, exy are the
    Green-Lagrange strain, if it is given. One more column names the outcome. A lost point has a row with
    empty cells for its numbers.

    ``folder``: folder of the files; created if absent. The files are ``frame_0000.csv`` and so on.
    ``strain``: strain of every point, NaN where it has none [-], shape [n_frames, n_points, 3]. Raises
    ValueError if the strain has another shape. Raises OSError if a file cannot be written; an older file is
    then unchanged.
    """
    surface = body.surface
    shape = (surface.n_frames, surface.n_points, 3)
    if strain is not None and strain.shape != shape:
        raise ValueError(f"strain has shape {strain.shape}, must be {shape}")
    folder.mkdir(parents=True, exist_ok=True)
    names = ["X", "Y", "Z", "U", "V", "W", "x", "y", "Sigma", "sigma_X", "sigma_Y", "sigma_Z", "e"]
    names += list(STRAINS) if strain is not None else []
    outcomes = np.array([member.name for member in PointOutcome])
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
        written.append(folder / f"frame_{frame:04d}.csv")
        named = dict(zip(names, table.T, strict=True))
        write_history(written[-1], {**named, "outcome": outcomes[surface.outcome[frame]]}, digits=7)
    return written


def write_history(path: Path, columns: Mapping[str, NDArray[Any]], *, digits: int = 9) -> None:
    """Write columns of equal length, with units in their names, as one table; NaN becomes an empty cell."""
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"columns have different lengths: {lengths}")
    with replacing(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([text_cell(name) for name in columns])
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            writer.writerow([_cell(value, digits) for value in row])


def _cell(value: float | int | str, digits: int) -> float | int | str:
    if isinstance(value, float):
        return f"{value:.{digits}g}" if np.isfinite(value) else ""
    return text_cell(value) if isinstance(value, str) else value


def write_full_field_frames(folder: Path, result: FullField) -> list[Path]:
    """Write the points of a full field, one file per frame: ``frame_0000.csv`` and so on.

    Each point has one row. The first columns are the position x0, y0 in the reference picture [px]. Then
    follow X, Y, Z, U, V, W with sigma_U, sigma_V, sigma_W in the unit of the headings, and the Green-Lagrange
    strains exx, eyy, exy with their sigmas. The last columns are the lowest correlation of the cameras, the
    epipolar distance and the outcome. An unknown number is an empty cell.
    """
    folder.mkdir(parents=True, exist_ok=True)
    surface, unit, written = result.surface, result.unit, []
    names = np.array([member.name for member in PointOutcome])
    for frame in range(surface.n_frames):
        columns = {"x0 (px)": result.points[:, 0], "y0 (px)": result.points[:, 1]}
        columns |= {f"{name} ({unit})": surface.X[:, k] for k, name in enumerate("XYZ")}
        columns |= {f"{name} ({unit})": surface.u[frame, :, k] for k, name in enumerate("UVW")}
        columns |= {f"sigma_{name} ({unit})": surface.sigma[frame, :, k] for k, name in enumerate("UVW")}
        columns |= {name: result.strain.value[frame, :, k] for k, name in enumerate(STRAINS)}
        columns |= {f"sigma_{name}": result.strain.sigma[frame, :, k] for k, name in enumerate(STRAINS)}
        columns["zncc"] = result.zncc[:, frame].min(axis=0)
        columns["epipolar (px)"] = result.epipolar[frame]
        columns["outcome"] = names[surface.outcome[frame]]
        path = folder / f"frame_{frame:04d}.csv"
        write_history(path, columns)
        written.append(path)
    return written


def write_full_field_history(path: Path, result: FullField) -> None:
    """Write the table of `full_field_columns`; NaN is an empty cell."""
    write_history(path, full_field_columns(result))


def full_field_columns(result: FullField) -> dict[str, NDArray[Any]]:
    """Columns with one value per frame: points found, mean strains, extensometers and fitted cylinder."""
    unit, mean = result.unit, result.mean_strain
    columns = {
        "frame": np.arange(result.surface.n_frames),
        "time (s)" if result.timed else "time (frames)": result.surface.t,
        "outcome": np.array([FrameOutcome(int(k)).name for k in result.frame_outcome]),
        "points": result.n_valid,
        **{f"mean {name}": mean[:, k] for k, name in enumerate(STRAINS)},
    }
    for one in result.extensions:
        columns |= {
            f"{one.name} length ({unit})": one.length,
            f"{one.name} elongation ({unit})": one.elongation,
            f"{one.name} sigma ({unit})": one.sigma,
            f"{one.name} strain": one.strain,
            f"{one.name} outcome": np.array([StrainOutcome(int(k)).name for k in one.outcome]),
        }
    if result.cylinder is not None:
        columns |= {
            "radius (m)": result.cylinder.radius,
            "sigma of the radius (m)": result.cylinder.sigma,
            "rms from the cylinder (m)": result.cylinder.rms,
        }
    return columns


COMPONENTS = ("x", "y", "Z")
"""Names of the last axis of positions."""


def pandas() -> Any:
    """The package pandas; an ImportError explains how to install it."""
    try:
        import pandas as package
    except ImportError:
        raise ImportError("this needs pandas: pip install pandas") from None
    return package


def html_table(caption: str, rows: list[tuple[str, str]]) -> str:
    """Names and values as an HTML table; all text is escaped."""
    from html import escape

    align = ' style="text-align:left"'
    body = "".join(
        f"<tr><th{align}>{escape(name)}</th><td{align}>{escape(value)}</td></tr>" for name, value in rows
    )
    return f"<table><caption>{escape(caption)}</caption><tbody>{body}</tbody></table>"


def facts(surface: SurfaceHistory) -> list[tuple[str, str]]:
    """Summary of a surface: frames, points, times, outcomes, sigma."""
    rows = [("frames", str(surface.n_frames)), ("points", str(surface.n_points))]
    if surface.n_frames:
        rows.append(("time", f"{1e3 * surface.t[0]:.6g} to {1e3 * surface.t[-1]:.6g} ms"))
    total = surface.outcome.size
    for value, count in zip(*np.unique(surface.outcome, return_counts=True), strict=True):
        name = PointOutcome(value).name.lower().replace("_", " ")
        rows.append((name, f"{count} ({100.0 * count / total:.3g} %)"))
    if surface.valid.any():
        median = np.median(surface.sigma[surface.valid], axis=0)
        text = ", ".join(f"{name} {1e6 * value:.3g}" for name, value in zip(COMPONENTS, median, strict=True))
        rows.append(("median standard deviation (µm)", text))
    return rows


def to_dataframe(surface: SurfaceHistory) -> Any:
    """One row per point and frame: time [s], reference X [m], displacement u [m], sigma [m], outcome."""
    frame, point = np.indices(surface.outcome.shape)
    columns: dict[str, NDArray[Any]] = {
        "frame": frame.ravel(),
        "point": point.ravel(),
        "t (s)": surface.t[frame].ravel(),
    }
    for k, name in enumerate(COMPONENTS):
        columns[f"X_{name} (m)"] = surface.X[point, k].ravel()
    valid = surface.valid
    for symbol, values in (("u", surface.u), ("sigma", surface.sigma)):
        for k, name in enumerate(COMPONENTS):
            columns[f"{symbol}_{name} (m)"] = np.where(valid, values[..., k], np.nan).ravel()
    names = {int(outcome): outcome.name.lower() for outcome in PointOutcome}
    columns["outcome"] = np.array([names[k] for k in surface.outcome.ravel().tolist()], dtype=object)
    return pandas().DataFrame(columns)


def points_dataframe(result: FullField) -> Any:
    """One row per point and frame: displacements u, v, w and strains with their sigmas; NaN for lost points.

    Lengths are in the result's unit. ``u``, ``v`` and ``w`` are along x, y and Z; a plane has no w. `outcome`
    is the number of the `PointOutcome`.
    """
    surface, strain = result.surface, result.strain
    frame, point = np.indices(surface.outcome.shape)
    columns: dict[str, Any] = {"frame": frame, "point": point, "t": surface.t[frame]}
    columns |= {f"X_{name}": surface.X[point, k] for k, name in enumerate(COMPONENTS)}
    columns |= {name: result.cell[point, k] for k, name in enumerate(("column", "row"))}
    for k, name in enumerate("uv" if result.kind == "plane" else "uvw"):
        columns[name] = np.where(surface.valid, surface.u[..., k], np.nan)
        columns[f"{name}_sigma"] = np.where(surface.valid, surface.sigma[..., k], np.nan)
    for k, name in enumerate(STRAINS):
        columns[name], columns[f"{name}_sigma"] = strain.value[..., k], strain.sigma[..., k]
    columns["outcome"] = surface.outcome
    return pandas().DataFrame({name: values.ravel() for name, values in columns.items()})
