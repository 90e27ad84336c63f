"""A stereo result in words and numbers, and the reason for a missing displacement of the flyer."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dic.bodies.rest_from_rim import LARGEST_SHARE
from dic.outcome import FrameOutcome, PointOutcome
from dic.result import StereoResult
from kolsky.pictures.rig import refinement_words

SHOWN_FRAMES = 12
"""Largest number of frames that are listed individually. For more frames, the first ones and the total are
listed."""


def summary(result: StereoResult) -> dict[str, Any]:
    """Numbers of a result by name, in SI units and JSON types."""
    body, noise, placement = result.specimen, result.noise, result.placement
    rows: dict[str, Any] = {
        "frames": len(result.t),
        "static_frames": int(result.static.sum()),
        "frames_not_usable": bad_frames(result),
        "points": body.surface.n_points,
        "points_alive_at_the_end": int(body.n_valid[result.outcome == FrameOutcome.VALID][-1:].sum()),
        "points_lost": {words(one): count for one, count in body.outcomes().items() if not one.ok},
        "sigma_match_px": _median(np.fmax(*body.match_sigma)[body.surface.valid]),
        "sigma_x_y_Z_m": [_median(body.surface.sigma[..., k][body.surface.valid]) for k in range(3)],
        "epipolar_rms_px": body.epipolar_rms,
        "noise_floor_time_m": noise.time.tolist(),
        "noise_floor_space_m": noise.space.tolist(),
        "noise_floor_predicted_m": noise.sigma.tolist(),
        "strain_noise_around_along_shear": [None if np.isnan(v) else float(v) for v in result.strain_noise],
        "cylinder_radius_m": placement.radius,
        "cylinder_radius_sigma_m": placement.radius_sigma,
        "cylinder_rms_m": placement.rms,
        "centre_line_points": int(result.centre.Z.size),
        "centre_line_sigma_m": _median(result.centre.sigma),
    }
    if result.axial_displacement is not None and result.axial_displacement.t.size:
        rows |= {
            "flyer_frames": int(result.axial_displacement.t.size),
            "flyer_travel_m": float(np.ptp(result.axial_displacement.displacement)),
            "flyer_sigma_m": _median(result.axial_displacement.sigma),
            "flyer_rest_sigma_m": result.axial_displacement.rest_sigma,
        }
        if result.axial_displacement.rim_disagreement is not None:
            off, sigma = result.axial_displacement.rim_disagreement
            rows |= {"rim_above_declared_length_m": off, "rim_above_declared_length_sigma_m": sigma}
    return rows


AXES = {
    "sigma_x_y_Z_m": ("sigma_x_m", "sigma_y_m", "sigma_Z_m"),
    **{
        f"noise_floor_{kind}_m": tuple(f"noise_floor_{kind}_{axis}_m" for axis in ("x", "y", "Z"))
        for kind in ("time", "space", "predicted")
    },
    "strain_noise_around_along_shear": ("strain_noise_around", "strain_noise_along", "strain_noise_shear"),
}
"""Names of the components of the lists in `summary`."""


def numbers(result: StereoResult) -> dict[str, float]:
    """The numbers of `summary`, each with its unit in its name. NaN replaces None."""
    found: dict[str, float] = {}
    for name, value in summary(result).items():
        if name == "frames_not_usable":
            found[name] = float(len(value))
        elif isinstance(value, Mapping):
            found |= {f"{name}, {part}": float(count) for part, count in value.items()}
        elif isinstance(value, list):
            found |= dict(zip(AXES[name], map(_or_nan, value), strict=True))
        else:
            found[name] = _or_nan(value)
    return found


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else float(value)


def printed(result: StereoResult) -> dict[str, str]:
    """The summary as a table for a terminal, in px, µm and mm."""
    rows, um = summary(result), 1e6
    triple = {
        name: ", ".join(f"{um * value:.2f}" for value in rows[name])
        for name in ("sigma_x_y_Z_m", "noise_floor_time_m", "noise_floor_space_m", "noise_floor_predicted_m")
    }
    bad = rows["frames_not_usable"]
    table = {
        "frames": f"{rows['frames']}, {rows['static_frames']} static, {len(bad)} not usable",
        "points": f"{rows['points']}, {rows['points_alive_at_the_end']} alive at the end",
        "points lost, by outcome": ", ".join(f"{count} {name}" for name, count in rows["points_lost"].items())
        or "none",
        "sigma of a match": f"{rows['sigma_match_px']:.4f} px",
        "sigma of x, y, Z": f"{triple['sigma_x_y_Z_m']} µm",
        "epipolar rms": f"{rows['epipolar_rms_px']:.4f} px",
        "noise floor in time": f"{triple['noise_floor_time_m']} µm (x, y, Z)",
        "noise floor in space": f"{triple['noise_floor_space_m']} µm",
        "noise predicted": f"{triple['noise_floor_predicted_m']} µm",
    }
    if all(value is not None for value in rows["strain_noise_around_along_shear"]):
        table["strain noise"] = (
            ", ".join(f"{um * value:.0f}" for value in rows["strain_noise_around_along_shear"])
            + " µm/m (around, along, shear)"
        )
    table["cylinder at rest"] = (
        f"radius {1e3 * rows['cylinder_radius_m']:.4f} mm ± {2e6 * rows['cylinder_radius_sigma_m']:.1f} µm "
        f"(k = 2), points {um * rows['cylinder_rms_m']:.1f} µm rms off it"
    )
    table["centre line"] = (
        f"{rows['centre_line_points']} points, sigma {um * rows['centre_line_sigma_m']:.2f} µm"
    )
    if "flyer_travel_m" in rows:
        table["flyer"] = (
            f"{1e3 * rows['flyer_travel_m']:.4f} mm in {rows['flyer_frames']} frames, sigma "
            f"{um * rows['flyer_sigma_m']:.2f} µm, at rest "
            f"{um * rows['flyer_rest_sigma_m']:.2f} µm"
        )
    if "rim_above_declared_length_m" in rows:
        table["rim of the flyer at rest"] = (
            f"{um * rows['rim_above_declared_length_m']:+.1f} µm from the specimen's upper end by its "
            "declared length, "
            f"± {2.0 * um * rows['rim_above_declared_length_sigma_m']:.1f} µm (k = 2, of both)"
        )
    if said := refinement_words(result.facts.get("refinement", {})):
        table["pose refined from the speckles"] = said
    found = result.facts.get("regions", {}).get("found", [])
    if found:
        regions = result.facts["regions"]
        places = "; ".join(_place(key, regions) for key in found)
        table["found in the pictures"] = places + (f" ({regions['why']})" if regions.get("why") else "")
    for frame, name in list(bad.items())[:SHOWN_FRAMES]:
        outcome = FrameOutcome[name.upper().replace(" ", "_")]
        table[f"frame {frame}"] = f"{name}: {outcome.cause}"
    if len(bad) > SHOWN_FRAMES:
        table["further frames"] = f"{len(bad) - SHOWN_FRAMES}"
    return table


def _place(key: str, regions: Mapping[str, Any]) -> str:
    """A detected region as text: its extent in px, and its frame."""
    if key == "transmission_edge":
        x, y = regions[key]
        return f"transmission edge ({x:.4g}, {y:.5g}) px"
    x, y = zip(*regions[key], strict=True)
    frame = regions[f"{key}_frame"]
    return f"{key} x {min(x):g} to {max(x):g}, y {min(y):g} to {max(y):g} px in frame {frame}"


def bad_frames(result: StereoResult) -> dict[str, str]:
    """Frames without points and their outcomes. Frames are counted from 0."""
    outcomes = enumerate(map(FrameOutcome, result.outcome.tolist()))
    return {str(k): words(outcome) for k, outcome in outcomes if outcome != FrameOutcome.VALID}


def words(outcome: PointOutcome | FrameOutcome) -> str:
    """An outcome as readable text, e.g. "low correlation"."""
    return outcome.name.lower().replace("_", " ")


def warnings(result: StereoResult) -> list[str]:
    """The remarks of a result, each with its remedy."""
    return [f"{remark.name}: {remark.text}; {remark.cure}" for remark in result.remarks]


def _median(values: np.ndarray) -> float | None:
    return float(np.median(values)) if values.size else None


LEAST_SUBSET = 11
"""Smallest proposed subset [px]. A smaller one contains too few speckles."""


def flyer_problem(
    result: StereoResult, length: float, length_sigma: float, subset: int = LEAST_SUBSET
) -> tuple[str, str]:
    """The reason why the flyer's displacement is unknown, and the remedy.

    Each is a text that follows the region's key. ``length``: length of the specimen at rest [m].
    ``length_sigma``: its declared standard uncertainty [m]. ``subset``: side of the subsets [px]. If the
    flyer's region is narrower, a smaller subset is the first remedy.
    """
    seen = np.zeros(0, dtype=np.int64) if result.flyer is None else np.flatnonzero(result.flyer.n_valid)
    if not seen.size:
        return (
            "shows no point that both cameras see, so its travel is not known",
            f"{_smaller_subset(result, subset)}declare a region that both cameras see, in a frame that shows "
            "much of it; if there is none, check crop_offset and the calibration of both cameras",
        )
    first = f"is first seen by both cameras in frame {seen[0]}, after it moved"
    lower = float(np.sqrt(result.placement.frame.covariance[4, 4]))
    known, allowed = float(np.hypot(length_sigma, lower)), LARGEST_SHARE * length
    if known > allowed:
        return (
            f"{first}; its place at rest is the specimen's upper end, which by length "
            f"({1e6 * length_sigma:.1f} um) and lower end ({1e6 * lower:.1f} um) is known to "
            f"{1e6 * known:.1f} um, allowed {1e6 * allowed:.1f} um",
            "measure the length to 0.1 % and declare it in uncertainty.specimen_length, or set the cameras "
            "so that both show the flyer at rest",
        )
    return (
        f"{first}, and the rim of its face, which would locate it, is not clear in enough frames, "
        "or the cameras put it too far apart",
        "declare a region that ends 2 to 8 pixels before the edge of its face, in a frame that shows much of "
        "it, or set the cameras so that both show the flyer at rest",
    )


def _smaller_subset(result: StereoResult, subset: int) -> str:
    """The remedy for a region narrower than a subset, as the start of a sentence; empty if wide enough."""
    corners = np.array(result.facts.get("regions", {}).get("flyer", np.zeros((0, 2))), dtype=np.float64)
    if not corners.size:
        return ""
    across = int(np.ptp(corners, axis=0).min()) + 1
    fitting = max(across - 1 + across % 2, LEAST_SUBSET)  # odd
    if fitting >= subset:
        return ""
    return (
        f"set `subset = {fitting}` in [dic], as its region is {across} px across and a subset {subset}; or "
    )
