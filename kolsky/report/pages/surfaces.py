"""Pages of measurements from pictures: the surfaces of a shot, a full field, a calibration."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dic import output
from dic.calibration.views import Calibration
from dic.outcome import FrameOutcome, PointOutcome
from dic.result import FullField
from kolsky.bars.flyer import flight
from kolsky.pictures import summary as picture_summary
from kolsky.pictures.rig import refinement_words
from kolsky.pictures.summary import words
from kolsky.report.pages.rendering import draw_figures, render_page, sentences
from kolsky.report.picture_views import FullFieldView, SurfaceView
from kolsky.results import numbers


def rows_of_points(counts: Mapping[PointOutcome, int], total: int, **more: Any) -> list[dict[str, Any]]:
    """Return one row per outcome: its count, share of `total`, cause and remedy, after `more` entries."""
    return [
        {
            **more,
            "Outcome": words(outcome),
            "Count": count,
            "Share": f"{100.0 * count / max(total, 1):.3g} %",
            "Cause and cure": outcome.cause if outcome.ok else f"{outcome.cause}. Cure: {outcome.cure}",
            "lost": not outcome.ok,
        }
        for outcome, count in sorted(counts.items())
    ]


def rows_of_frames(bad: Mapping[Any, FrameOutcome]) -> list[tuple[str, str]]:
    """Return the frames without points: number, and outcome with cause and remedy."""
    return [(str(frame), f"{words(one)}: {one.cause}. Cure: {one.cure}") for frame, one in bad.items()]


def render_surfaces(shown: SurfaceView, inputs: Mapping[str, str], *, processes: int = 1) -> str:
    """Return the page as HTML text."""
    result = shown.result
    table = output.reporting_table(result)
    return render_page(
        "surfaces.html",
        kind="Surfaces from two series of pictures",
        heading=shown.shot,
        subject="surfaces",
        figures=draw_figures(shown, processes=processes),
        rows=list({**picture_summary.printed(result), **flight.printed(shown.flight)}.items()),
        warnings=[f"{r.name.capitalize()}. {r.text}. Cure: {r.cure}." for r in result.remarks],
        outcomes=_outcomes(shown),
        frames=rows_of_frames(
            {
                frame: FrameOutcome[name.upper().replace(" ", "_")]
                for frame, name in picture_summary.bad_frames(result).items()
            }
        ),
        parts=[
            (part, [(row.name, row.value) for row in table if row.part == part])
            for part in dict.fromkeys(r.part for r in table)
        ],
        inputs=list(inputs.items()),
        seconds=[(name, f"{value:.3g} s") for name, value in result.seconds.items()],
    )


def _outcomes(shown: SurfaceView) -> list[dict[str, Any]]:
    """Return the outcomes of points by body, with cause and remedy."""
    rows = []
    for name, body in (("specimen", shown.result.specimen), ("flyer", shown.result.flyer)):
        if body is not None:
            rows += rows_of_points(body.outcomes(), body.surface.outcome.size, Body=name)
    return rows


AXES = {
    "plane": "x to the right and y down, as in the picture.",
    "surface": "x to the right and y up in the plane that fits the reference best, Z toward the cameras.",
    "cylinder": "y along the axis of the cylinder, Z from the axis toward the cameras.",
}
KINDS = {
    "plane": "Plane surface, one camera",
    "surface": "Curved surface, two cameras",
    "cylinder": "Cylinder, two cameras",
}


def render_field(shown: FullFieldView, inputs: Mapping[str, str]) -> str:
    """Return the page as HTML text."""
    result = shown.result
    return render_page(
        "full_field.html",
        kind=KINDS[result.kind],
        heading=shown.name,
        subject="full-field measurement",
        figures=draw_figures(shown),
        rows=list(printed(result).items()),
        warnings=sentences(warnings(result)),
        outcomes=rows_of_points(result.outcomes(), result.surface.outcome.size),
        frames=rows_of_frames(result.bad_frames()),
        settings=[
            (name.replace("_", " "), str(value))
            for name, value in result.facts.items()
            if name != "refinement"
        ],
        inputs=list(inputs.items()),
        axes=AXES[result.kind],
    )  # fmt: skip


def warnings(result: FullField) -> list[str]:
    """Return the warnings about a result."""
    texts = [f"{remark.name}: {remark.text}; {remark.cure}" for remark in result.remarks]
    texts += [
        f"frame {frame} gave no points: {outcome.cause}; {outcome.cure}"
        for frame, outcome in result.bad_frames().items()
    ]
    missing = result.facts.get("points_without_reference", 0)
    if missing:
        texts.append(
            f"{missing} of {missing + len(result.points)} points of the region were not matched at the "
            "reference and are in no table"
        )
    return texts


def summary(result: FullField) -> dict[str, Any]:
    """Return the numbers of a result by name, SI (or px) and JSON types."""
    valid = result.surface.valid
    sigma = np.where(valid[..., None], result.surface.sigma, np.nan)[1:] if len(valid) > 1 else np.empty(0)
    last = int(np.flatnonzero(result.n_valid)[-1]) if result.n_valid.any() else None
    unit = result.unit
    rows: dict[str, Any] = {
        "kind": result.kind,
        "frames": result.surface.n_frames,
        "frames_not_usable": {str(k): words(v) for k, v in result.bad_frames().items()},
        "points": len(result.points),
        "points_found_share": float(valid.mean()) if valid.size else 0.0,
        "points_lost": {words(k): n for k, n in result.outcomes().items() if not k.ok},
        "grey_noise": result.noise.tolist(),
        f"sigma_u_v_w_{unit}": [_median(sigma[..., k]) for k in range(3)] if sigma.size else None,
        "strain_sigma": _median(result.strain.sigma),
    }
    if np.isfinite(result.epipolar).any():
        rows["epipolar_median_px"] = _median(np.abs(result.epipolar))
    if last is not None:
        rows["last_frame"] = last
        rows["mean_strain_xx_yy_xy"] = [_finite(value) for value in result.mean_strain[last]]
        rows["extensometers"] = {
            one.name: {
                f"elongation_{unit}": _finite(one.elongation[last]),
                f"sigma_{unit}": _finite(one.sigma[last]),
                "strain": _finite(one.strain[last]),
            }
            for one in result.extensions
        }
    if refinement := result.facts.get("refinement"):
        rows["refinement"] = refinement
    if result.cylinder is not None:
        k, c = int(result.facts.get("reference", 0)), result.cylinder
        rows["radius_m"], rows["radius_sigma_m"] = _finite(c.radius[k]), _finite(c.sigma[k])
        rows["radius_uncorrected_m"], rows["curvature_bias_px"] = _finite(c.uncorrected), c.correction
    return rows


def printed(result: FullField) -> dict[str, str]:
    """Return the numbers of a result as a terminal and the page show them."""
    rows, unit = summary(result), result.unit
    factor, name = (1e6, "µm") if unit == "m" else (1e3, "mpx")
    table = {
        "kind": KINDS[result.kind],
        "frames": f"{rows['frames']}, {len(rows['frames_not_usable'])} not usable",
        "points": f"{rows['points']}, found in {100.0 * rows['points_found_share']:.4g} % of the frames",
        "noise of the grey values": ", ".join(f"{value:.3g}" for value in rows["grey_noise"])
        + f" ({result.facts.get('noise_from')})",
    }
    if rows[f"sigma_u_v_w_{unit}"]:
        values = [value for value in rows[f"sigma_u_v_w_{unit}"] if value is not None]
        values = values[:2] if result.kind == "plane" else values
        table["sigma of a displacement"] = f"{', '.join(f'{factor * v:.3g}' for v in values)} {name}"
    if rows["strain_sigma"] is not None:
        table["sigma of a strain"] = f"{1e6 * rows['strain_sigma']:.3g} µm/m"
    if "epipolar_median_px" in rows:
        table["epipolar distance, median"] = f"{rows['epipolar_median_px']:.4f} px"
    if texts := refinement_words(result.facts.get("refinement", {})):
        table["pose refined from the speckles"] = texts
    if "last_frame" in rows:
        strain = ", ".join("-" if v is None else f"{100.0 * v:.4f}" for v in rows["mean_strain_xx_yy_xy"])
        table[f"mean strain xx, yy, xy in frame {rows['last_frame']}"] = f"{strain} %"
        for key, one in rows["extensometers"].items():
            if one["strain"] is None:
                table[f"extensometer {key}"] = f"not known in frame {rows['last_frame']}"
                continue
            length, sigma = (factor * one[f"{word}_{unit}"] for word in ("elongation", "sigma"))
            table[f"extensometer {key}"] = (
                f"{length:.5g} ± {2.0 * sigma:.2g} {name} (k = 2), strain {100.0 * one['strain']:.4f} %"
            )
    if rows.get("radius_m") is not None:
        table["radius at the reference"] = (
            f"{1e3 * rows['radius_m']:.4f} ± {2e3 * rows['radius_sigma_m']:.4f} mm (k = 2); "
            f"{1e3 * rows['radius_uncorrected_m']:.4f} mm without the correction for curvature"
        )
    return table


def _median(values: np.ndarray) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def render_calibration(name: str, result: Calibration) -> str:
    """Return the page as HTML text."""
    return render_page(
        "calibration.html",
        kind="Two cameras from pictures of a target",
        heading=name,
        subject="calibration",
        figures=draw_figures(result),
        rows=list(calibration_summary(result).items()),
        warnings=sentences(calibration_warnings(result)),
        pairs=[pair_row(pair) for pair in result.pairs],
    )


def pair_row(pair: Any) -> dict[str, Any]:
    """Return the row of one pair of images."""
    points = [0 if view is None else int(view.used.sum()) for view in pair.views]
    rms = ["" if view is None else f"{view.rms:.4f}" for view in pair.views]
    texts = (
        "" if pair.outcome.value == 0 else f"{pair.outcome.cause}: {pair.reason}. Cure: {pair.outcome.cure}"
    )
    outcome = pair.outcome.name.lower().replace("_", " ")
    return {
        "Pair": pair.name,
        **{f"Camera {k}": value for k, value in enumerate(rms)},
        "Points": " + ".join(map(str, points)),
        "Outcome": f"{outcome}. {texts}" if texts else outcome,
        "lost": not pair.outcome.used,
    }


_PX = ("fx", "fy", "cx", "cy", "skew")


def calibration_summary(result: Calibration) -> dict[str, str]:
    """Return a name and a value for each line of the table."""
    checks, sigma = result.checks, result.sigma
    used = sum(pair.outcome.used for pair in result.pairs)
    rows = {
        "pairs used": f"{used} of {len(result.pairs)}",
        "residual, rms": f"{checks.fit_rms:.4f} px ({result.unit:.3g} times the pictures' noise)",
        "held-out pairs, rms": f"{checks.held_out_rms:.4f} px"
        if checks.held_out_rms > 0
        else "too few pairs",
        "distances on the target": f"{1e6 * (checks.distance_ratio - 1.0):+.1f} ppm, points off by "
        f"{1e6 * checks.distance_rms:.2f} um rms",
        "clustering of residuals": f"{result.clustering:.2f} (1: independent)",
    }
    for k, camera in enumerate(result.rig.cameras):
        values = {
            "fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy, "skew": camera.skew,
            **dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion, strict=True)),
        }  # fmt: skip
        rows |= {
            f"camera {k}, {name}": _measured(values[name], sigma[f"{name}{k}"], "px" if name in _PX else "")
            for name in result.free
        }
    from scipy.spatial.transform import Rotation

    R, t = result.rig.relative
    angle = Rotation.from_matrix(R).magnitude()
    rows["stereo angle"] = f"{57.29577951308232 * angle:.4f} deg"
    rows |= {
        f"relative {name}": _measured(1e3 * value, 1e3 * sigma[name], "mm")
        for name, value in zip(("tx", "ty", "tz"), t, strict=True)
    }
    return rows


def calibration_warnings(result: Calibration) -> list[str]:
    """Return the warnings about a calibration."""
    texts = [
        f"pair {pair.name} was left out: {pair.reason}. Cure: {pair.outcome.cure}" for pair in result.rejected
    ]
    texts += [f"pair {pair.name}: {pair.reason}; export it again" for pair in result.unusable]
    if result.clustering > 2.0:
        texts.append(
            f"residuals within a picture are correlated (factor {result.clustering:.1f} on variances): the "
            "target may be bent or misprinted, or the lens model too simple; sigmas are enlarged accordingly"
        )
    return [*texts, *result.advice]


def _measured(value: float, sigma: float, unit: str) -> str:
    best, uncertainty = numbers.measured(float(value), 2.0 * sigma) if sigma > 0.0 else (f"{value:.6g}", "0")
    return numbers.plain_sentence(f"{best} ± {uncertainty} {unit}".strip()) + " (k = 2)"
