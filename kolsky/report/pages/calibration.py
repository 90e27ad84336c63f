"""Page of a stereo calibration: figures, parameters with their uncertainties, every pair of images."""

from typing import Any

from dic.calibration.views import Calibration
from kolsky.report.figures import CALIBRATION
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers
from kolsky.results import numbers as plain_text


def render(name: str, result: Calibration) -> str:
    """Return the page as HTML text; see `write_page`."""
    return render_page(
        "calibration.html",
        kind="Two cameras from pictures of a target",
        heading=name,
        subject="calibration",
        figures=draw_figures(CALIBRATION.values(), result),
        rows=list(summary(result).items()),
        warnings=sentences(warnings(result)),
        pairs=[_row(pair) for pair in result.pairs],
    )


write_page = page_writer(render)


def _row(pair: Any) -> dict[str, Any]:
    """Return the row of one pair of images."""
    points = [0 if view is None else int(view.used.sum()) for view in pair.views]
    rms = ["" if view is None else f"{view.rms:.4f}" for view in pair.views]
    texts = (
        "" if pair.outcome.value == 0 else f"{pair.outcome.cause}: {pair.reason}. Cure: {pair.outcome.cure}"
    )
    return {
        "name": pair.name, "rms": rms, "points": points, "ok": pair.outcome.used, "said": texts,
        "outcome": pair.outcome.name.lower().replace("_", " "),
    }  # fmt: skip


_PX = ("fx", "fy", "cx", "cy", "skew")


def summary(result: Calibration) -> dict[str, str]:
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


def warnings(result: Calibration) -> list[str]:
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
    return plain_text.plain_sentence(f"{best} ± {uncertainty} {unit}".strip()) + " (k = 2)"
