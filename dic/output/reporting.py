"""The table that a publication must give about its DIC, filled in from a result.

Its entries are those of the reporting requirements in the iDICs Good Practices Guide (International Digital
Image Correlation Society, Jones and Iadicola (eds.), 2nd edition): hardware, pattern, analysis and noise
floors.
"""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dic.files import text_cell
from dic.result import StereoResult

NOT_STATED = "not stated"
STATED = ("camera", "lens", "aperture", "exposure", "lighting", "pattern")
"""Facts that no file holds and a person may state in words."""


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    part: str
    """"hardware", "pattern", "analysis" or "noise floor"."""
    name: str
    """Name of the quantity."""
    value: str
    """Number with unit, words, or `NOT_STATED`."""


def reporting_table(result: StereoResult) -> tuple[Row, ...]:
    """The reporting table of a result, in the order of the guide."""
    facts = result.facts
    return (*_hardware(result, facts), *_pattern(result, facts), *_analysis(result, facts), *_noise(result))


def geometry(result: StereoResult) -> dict[str, float]:
    """Geometry of the cameras about the specimen.

    Returns
    -------
    dict
        "scale_x", "scale_y": pixels of camera 0 per metre across and along the specimen; "stereo_angle"
        [rad];
        "distance" of camera 0 from the surface [m].
    """
    first, second = result.rig.cameras
    frame = result.placement.frame
    middle = result.specimen.surface.X.mean(axis=0)
    at = frame.origin + frame.rotation.T @ middle
    small = 1e-5
    seen = first.project(np.stack([at, *(at + small * frame.rotation[axis] for axis in (0, 1))]))
    scale = np.linalg.norm(seen[1:] - seen[0], axis=1) / small
    views = [(at - camera.centre) / np.linalg.norm(at - camera.centre) for camera in (first, second)]
    return {
        "scale_x": float(scale[0]),
        "scale_y": float(scale[1]),
        "stereo_angle": float(np.arccos(np.clip(views[0] @ views[1], -1.0, 1.0))),
        "distance": float(np.linalg.norm(at - first.centre)),
    }


def _hardware(result: StereoResult, facts: Mapping[str, Any]) -> list[Row]:
    stated = {name: facts.get("reporting", {}).get(name) or NOT_STATED for name in STATED}
    pictures, seen = facts["pictures"], geometry(result)
    rows, columns = pictures["shape"]
    per_mm = (1e-3 * seen["scale_x"], 1e-3 * seen["scale_y"])
    sensors = [camera.sensor for camera in result.rig.cameras]
    sensor = "; ".join(f"{s[0]} x {s[1]} px" for s in sensors if s is not None)
    crops = "; ".join(f"({x:g}, {y:g})" for x, y in pictures["crop_offset"])
    entries = [
        ("camera", stated["camera"]),
        ("sensor", sensor or NOT_STATED),
        ("image resolution", f"{columns} x {rows} px at {crops} px of the sensors, {pictures['bits']} bits"),
        ("lens", stated["lens"]),
        ("aperture", stated["aperture"]),
        ("exposure", stated["exposure"]),
        ("lighting", stated["lighting"]),
        ("field of view", f"{columns / per_mm[0]:.3g} x {rows / per_mm[1]:.3g} mm"),
        ("image scale", f"{per_mm[0]:.4g} px/mm across, {per_mm[1]:.4g} px/mm along the axis"),
        ("stereo angle", f"{np.degrees(seen['stereo_angle']):.4g} degrees"),
        ("stand-off distance", f"{1e3 * seen['distance']:.4g} mm"),
        (
            "image acquisition rate",
            f"{1.0 / np.median(np.diff(result.t)):.6g} frames/s, {len(result.t)} frames",
        ),
        ("patterning technique", stated["pattern"]),
    ]
    return [Row("hardware", name, value) for name, value in entries]


def _pattern(result: StereoResult, facts: Mapping[str, Any]) -> list[Row]:
    """The speckle report, camera by camera."""
    seen = geometry(result)
    per_mm = 1e-3 * float(np.sqrt(seen["scale_x"] * seen["scale_y"]))
    subset, rows = facts["settings"]["subset"], []
    for camera, found in enumerate(facts.get("speckle", ())):
        if "problem" in found:
            rows.append(Row("pattern", f"camera {camera}", f"{NOT_STATED}: {found['problem']}"))
            continue
        (x, y), edges = found["size"], found["size_by_edges"]
        entries = [
            (
                "feature size",
                f"{x:.3g} x {y:.3g} px by autocorrelation, {edges:.3g} px by edges; "
                f"{0.5 * (x + y) / per_mm:.3g} mm",
            ),
            ("coverage", f"{100.0 * found['coverage']:.3g} % dark"),
            ("mean intensity gradient", f"{found['mean_gradient']:.4g} grey/px"),
            ("grey noise", f"{found['noise']:.3g} grey"),
        ]
        if found["floor"] is not None:
            entries.append(
                (
                    "predicted noise floor",
                    f"{found['floor']:.2g} px, median over subsets of {subset} px",
                )
            )
            needed = "no subset tried" if found["needed"] is None else f"one of {found['needed']} px"
            entries.append(
                (
                    "subset too small",
                    f"at {100.0 * found['too_small']:.2g} % of the places for {found['wanted']:g} px; "
                    f"{needed} would do at 95 %",
                )
            )
        rows += [Row("pattern", f"{name}, camera {camera}", value) for name, value in entries]
    return rows or [Row("pattern", "feature size", NOT_STATED)]


def _analysis(result: StereoResult, facts: Mapping[str, Any]) -> list[Row]:
    settings = facts["settings"]
    subset, step, window = settings["subset"], settings["step"], settings["strain_window"]
    gauge = result.strain.gauge
    per_mm = 1e-3 * geometry(result)["scale_x"]
    prefilter = settings["prefilter"]
    entries = [
        ("software", str(facts.get("software", NOT_STATED))),
        (
            "image filtering",
            f"Gaussian, standard deviation {prefilter:g} px" if prefilter > 0.0 else "none",
        ),
        ("subset size", f"{subset} px, {subset / per_mm:.3g} mm"),
        ("step size", f"{step} px, {step / per_mm:.3g} mm"),
        (
            "subset shape function",
            f"{settings['shape']} in time, {settings['stereo_shape']} between the cameras",
        ),
        ("matching criterion", str(settings["criterion"])),
        ("interpolant", str(settings["interpolant"])),
        ("reference", str(settings["reference"])),
        ("strain window", f"{window} x {window} points"),
        ("virtual strain gauge", f"{gauge:g} px, {gauge / per_mm:.3g} mm"),
        (
            "strain formulation",
            "Green-Lagrange, from linear fits of the places at rest and now over the window",
        ),
        ("post-processing filter", "none"),
        ("calibration", str(facts.get("calibration", NOT_STATED))),
        ("epipolar distance, rms", f"{result.specimen.epipolar_rms:.3g} px"),
    ]
    return [Row("analysis", name, value) for name, value in entries]


def _noise(result: StereoResult) -> list[Row]:
    noise = result.noise
    axes = ("x, across", "y, along the axis", "Z, out of plane")
    rows = [
        Row(
            "noise floor",
            f"displacement {axis}",
            f"{1e6 * noise.time[k]:.3g} µm in time, {1e6 * noise.space[k]:.3g} µm in space "
            f"(predicted {1e6 * noise.sigma[k]:.3g} µm)",
        )
        for k, axis in enumerate(axes)
    ]
    for name, value in zip(("around the axis", "along the axis", "shear"), result.strain_noise, strict=True):
        text = NOT_STATED if not np.isfinite(value) else f"{1e6 * value:.3g} µm/m in time"
        rows.append(Row("noise floor", f"strain {name}", text))
    rows.append(
        Row(
            "noise floor",
            "taken from",
            f"{noise.n_frames} static frames, {noise.n_points} points valid in all",
        )
    )
    return rows


def as_csv(rows: tuple[Row, ...]) -> str:
    """The table as CSV; text that begins as a formula is guarded, see `dic.files.text_cell`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["part", "quantity", "value"])
    writer.writerows([text_cell(text) for text in (row.part, row.name, row.value)] for row in rows)
    return text.getvalue()


def as_markdown(rows: tuple[Row, ...]) -> str:
    """The table as Markdown."""
    lines = ["| part | quantity | value |", "| --- | --- | --- |"]
    lines += [f"| {' | '.join(_escaped(text) for text in (row.part, row.name, row.value))} |" for row in rows]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("\n", " ")
