"""Calibration of two cameras from what they saw of a target."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dic.calibration import checks
from dic.calibration.bundle import clustering
from dic.calibration.projection import View
from dic.calibration.rejection import Verdicts, solve_without_bad
from dic.calibration.result import Calibration, Checks, Pair, PairOutcome, PairView
from dic.calibration.rig_state import Fit, free_columns
from dic.calibration.start import start
from dic.calibration.targets.base import Detection, Target, TargetNotFound
from dic.calibration.views import all_views, finished_view
from dic.camera import PARAMETERS, StereoRig
from dic.images import PictureError

Seen = Detection | TargetNotFound | PictureError | None
Size = tuple[int, int]

MODELS: dict[str, tuple[str, ...]] = {
    "none": (),
    "k1": ("k1",),
    "k1 k2": ("k1", "k2"),
    "k1 k2 k3": ("k1", "k2", "k3"),
    "k1 p1 p2": ("k1", "p1", "p2"),
    "k1 k2 p1 p2": ("k1", "k2", "p1", "p2"),
    "k1 k2 p1 p2 k3": ("k1", "k2", "p1", "p2", "k3"),
}
"""Distortion models: coefficients that are adjusted, the others are zero."""


def calibrate(
    views0: Sequence[Seen],
    views1: Sequence[Seen],
    target: Target | Sequence[Target],
    *,
    sensors: tuple[Size, Size],
    distortion: str = "k1 k2",
    square_pixels: bool = False,
    skew: bool = False,
    names: Sequence[str] | None = None,
    reject: bool = True,
    folds: int = 5,
    predict: bool = True,
) -> Calibration:
    """Cameras, their relative pose and all covariances, from pairs of pictures of a target.

    All points of all pairs are adjusted together (`dic.calibration.bundle`). A pair that only one camera
    saw counts for that camera. Pairs that do not fit the cameras which the others agree on are left out
    with their reason, single points too far off as well.

    Parameters
    ----------
    views0, views1
        What camera 0 and camera 1 saw, one entry a pair: a `Detection`; the `TargetNotFound` that
        detecting raised; the `PictureError` of a picture that cannot be used; or None where there is none.
    target
        What was shown: one target, or one for each pair.
    sensors
        Columns and rows of the two cameras' calibration pictures [px]. For test pictures cropped from the
        same sensor use ``calibration.rig.cropped``.
    distortion
        A key of `MODELS`.
    square_pixels
        Adjust one focal length a camera, fx = fy.
    skew
        Adjust the shear of the pixel grid too.
    names
        Names of the pairs for the report; their numbers if not given.
    reject
        Look for bad pairs and points. False keeps all, whatever they are.
    folds
        Parts for the prediction of held-out pairs; 0 leaves the check out.
    predict
        Compare the calibration with what it was not told, held-out pairs and distances on the target; False
        for a caller that wants the cameras alone: the `Checks` of it are then NaN.

    Raises
    ------
    dic.calibration.rig_state.Undetermined
        If the pictures cannot determine what is asked for.
    ValueError
        Lengths that do not agree, or an unknown distortion model.
    """
    n = len(views0)
    targets = list(target) if isinstance(target, Sequence) else [target] * n
    names = [str(k) for k in range(n)] if names is None else list(names)
    if not len(views1) == len(targets) == len(names) == n:
        raise ValueError(
            f"views0, views1, targets and names must be equally many, got {n}, {len(views1)}, "
            f"{len(targets)}, {len(names)}"
        )
    if distortion not in MODELS:
        raise ValueError(f"distortion must be one of {', '.join(map(repr, MODELS))}, got {distortion!r}")
    free = ("fx", "fy", "cx", "cy", *(("skew",) if skew else ()), *MODELS[distortion])
    views = all_views((views0, views1), targets)
    rig, chosen = start(sensors, views)
    rough = free_columns(("fx", "fy"), square_pixels=True, relative=True)
    columns = free_columns(free, square_pixels=square_pixels, relative=True)
    fit, verdicts = solve_without_bad(rig, list(chosen.values()), (rough, columns), reject=reject)

    kept = verdicts.kept
    together = clustering(fit, kept, columns)
    found = StereoRig(fit.rig.cameras, fit.covariance * fit.unit**2 * max(1.0, together))
    off = np.concatenate([finished_view(fit.rig, s, np.ones(len(s.ids), dtype=bool)).residual for s in kept])
    ratio, ratio_sigma, shape = checks.distances(fit.rig, kept) if predict else 3 * (float("nan"),)
    return Calibration(
        rig=found,
        free=tuple(name for name in PARAMETERS if name in free),
        pairs=tuple(
            _pair(k, name, (views0[k], views1[k]), chosen, fit, verdicts) for k, name in enumerate(names)
        ),
        unit=fit.unit,
        clustering=together,
        freedom=fit.freedom,
        checks=Checks(
            fit_rms=float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
            held_out_rms=checks.held_out(fit, kept, columns, folds if predict else 0),
            folds=folds if predict else 0,
            distance_ratio=ratio,
            distance_sigma=ratio_sigma,
            distance_rms=shape,
        ),
        advice=checks.advice(found, free),
    )


def _said(view: TargetNotFound | PictureError | None) -> str:
    """Why there is no detection."""
    if view is None:
        return "no picture"
    return f"the picture cannot be used: {view}" if isinstance(view, PictureError) else str(view)


def _pair(
    k: int,
    name: str,
    views: tuple[Seen, Seen],
    chosen: dict[tuple[int, int], View],
    fit: Fit,
    verdicts: Verdicts,
) -> Pair:
    """The record of one pair."""
    missing = [
        f"camera {camera}: {_said(view)}"
        for camera, view in enumerate(views)
        if not isinstance(view, Detection)
    ]
    unusable = any(isinstance(view, PictureError) for view in views)
    if k not in fit.rig.poses:
        said = "; ".join(missing) or "no pose of the target explains what is seen"
        return Pair(name, PairOutcome.NOT_FOUND, said, (None, None), None, None, unusable)
    parts: list[PairView | None] = []
    for camera in (0, 1):
        view = chosen.get((k, camera))
        if view is None:
            parts.append(None)
        else:
            used = verdicts.used.get((k, camera), np.zeros(len(view.ids), dtype=bool))
            parts.append(finished_view(fit.rig, replace(view), used))
    R, t = fit.rig.poses[k]
    outcome, reason = PairOutcome.VALID, ""
    if k in verdicts.bad:
        outcome, reason = PairOutcome.INCONSISTENT, verdicts.bad[k]
    elif missing:
        outcome, reason = PairOutcome.ONE_CAMERA, "; ".join(missing)
    return Pair(name, outcome, reason, (parts[0], parts[1]), R, t, unusable)
