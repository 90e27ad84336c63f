"""Page of a full-field measurement: fields, histories, outcomes, settings."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dic.result import FullField
from kolsky.pictures.rig import refinement_words
from kolsky.pictures.summary import words
from kolsky.report.figures import FULL_FIELDS
from kolsky.report.pages import surfaces
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.report.picture_views import FullFieldView

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


def render(shown: FullFieldView, inputs: Mapping[str, str]) -> str:
    """Return the page as HTML text; see `write_page`."""
    result = shown.result
    return render_page(
        "full_field.html",
        kind=KINDS[result.kind],
        heading=shown.name,
        subject="full-field measurement",
        figures=draw_figures(FULL_FIELDS.values(), shown),
        rows=list(printed(result).items()),
        warnings=sentences(warnings(result)),
        outcomes=surfaces.rows_of_points(result.outcomes(), result.surface.outcome.size),
        frames=surfaces.rows_of_frames(result.bad_frames()),
        settings=[
            (name.replace("_", " "), str(value))
            for name, value in result.facts.items()
            if name != "refinement"
        ],
        inputs=list(inputs.items()),
        axes=AXES[result.kind],
    )  # fmt: skip


write_page = page_writer(render)


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
