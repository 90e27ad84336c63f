"""Predictions of a calibration to be compared with what it was not told: pairs left out, distances on the
target."""

from collections.abc import Sequence
from functools import partial
from itertools import groupby

import numpy as np

from dic.arrays import FloatArray
from dic.calibration.bundle import HARDLY, adjust
from dic.calibration.projection import SHARED, View, seen
from dic.calibration.rig_state import Fit, Rig, residuals
from dic.camera import StereoRig
from dic.forks import side_by_side

ENOUGH = 1e-7
"""Relative tolerance of the sum of squares of held-out pairs, from a start that is all but the solution."""


def by_pair(views: Sequence[View]) -> dict[int, list[View]]:
    """Views of each pair."""
    ordered = sorted(views, key=lambda s: (s.pair, s.camera))
    return {pair: list(views) for pair, views in groupby(ordered, key=lambda s: s.pair)}


def posed(rig: Rig, views: Sequence[View], *, tolerance: float = 1e-10) -> Fit:
    """The best pose of one target for given cameras."""
    return adjust(rig, views, np.zeros((SHARED, 0)), tolerance=tolerance)


def held_out(fit: Fit, views: Sequence[View], columns: FloatArray, folds: int) -> float:
    """Root mean square residual of pairs that the cameras were not fitted to [px].

    Pairs k, k + folds, ... are left out in turn, the rest is solved again, and of each pair left out only
    the target's pose is adjusted. NaN if a part leaves too little to solve.
    """
    pairs = by_pair(views)
    joint = [pair for pair, views in pairs.items() if len(views) == 2]
    if folds < 2 or len(joint) < 4:
        return float("nan")

    def part(k: int) -> tuple[float, int] | None:
        """Sum of squares and number of residuals of a part; None if the rest is too little."""
        out = set(joint[k::folds])
        try:
            kept = [s for s in views if s.pair not in out]
            without = adjust(fit.rig, kept, columns, tolerance=ENOUGH, damping=HARDLY)
        except ValueError:
            return None
        squares, count = 0.0, 0
        for pair in out:
            again = posed(without.rig, pairs[pair], tolerance=ENOUGH)
            off = np.concatenate([residuals(again.rig, s) for s in pairs[pair]])
            squares, count = squares + float(np.sum(off**2)), count + len(off)
        return squares, count

    parts = side_by_side([partial(part, k) for k in range(min(folds, len(joint)))])
    sums = [found for found in parts if found is not None]
    if len(sums) < len(parts):
        return float("nan")
    return float(np.sqrt(sum(squares for squares, _ in sums) / sum(count for _, count in sums)))


def triangulated(rig: Rig, views: Sequence[View]) -> tuple[FloatArray, FloatArray]:
    """Points of a target seen by both cameras: in space from what they saw alone [m], and on the target.

    The offset of a dot's centroid from its centre's image is taken off first.
    """
    # not with the module: the search for a target needs none of what this brings along
    from dic.stereo import triangulate

    first, second = views
    _, rows0, rows1 = np.intersect1d(first.ids, second.ids, return_indices=True)
    pixels = []
    for view, rows in ((first, rows0), (second, rows1)):
        camera = rig.cameras[view.camera]
        R, t = rig.poses[view.pair]
        shift = seen(camera, view, R, t) - seen(camera, view, R, t, patches=False)
        pixels.append((view.pixels - shift)[rows])
    found = triangulate(StereoRig(rig.cameras), pixels[0], pixels[1], np.eye(2), np.eye(2)).position
    return found, first.points[rows0]


def distances(rig: Rig, views: Sequence[View]) -> tuple[float, float, float]:
    """Triangulated over true distances on the target, the ratio's sigma, and the rms error of shape [m].

    The ratio is the scale of the similarity that carries the true points of each pair onto the
    triangulated ones, which weights each distance with its length.
    """
    ratios, squares, count = [], 0.0, 0
    for both in by_pair(views).values():
        if len(both) != 2:
            continue
        found, true = triangulated(rig, both)
        if len(found) < 4:
            continue
        a, b = true - true.mean(axis=0), found - found.mean(axis=0)
        u, _, v = np.linalg.svd(b.T @ a)
        R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
        turned = a @ R.T
        ratios.append(float(np.sum(turned * b) / np.sum(a * a)))
        squares, count = squares + float(np.sum((b - turned) ** 2)), count + len(b)
    if not ratios:
        return float("nan"), float("nan"), float("nan")
    spread = float(np.std(ratios, ddof=1) / np.sqrt(len(ratios))) if len(ratios) > 1 else float("nan")
    return float(np.mean(ratios)), spread, float(np.sqrt(squares / count))


def advice(rig: StereoRig, free: Sequence[str]) -> tuple[str, ...]:
    """Parameters that the pictures do not determine, and what to do about it."""
    assert rig.covariance is not None
    sigma = dict(zip(rig.parameter_names, np.sqrt(np.diag(rig.covariance)), strict=True))
    said = []
    for k, camera in enumerate(rig.cameras):
        own = dict(
            zip(("skew", "k1", "k2", "p1", "p2", "k3"), (camera.skew, *camera.distortion), strict=True)
        )
        said += [
            f"camera {k}: {name} = {own[name]:.3g} ± {sigma[f'{name}{k}']:.2g} is not determined "
            "(its sigma exceeds its value): leave it out"
            for name in own
            if name in free and sigma[f"{name}{k}"] > abs(own[name])
        ]
        if camera.sensor is None:
            continue
        size = dict(zip(("cx", "cy"), camera.sensor, strict=True))
        said += [
            f"camera {k}: {name} is known to ± {sigma[f'{name}{k}']:.1f} px only; a stronger tilt and roll "
            "of the target would settle it (a long lens trades it for the pose, as the covariance says)"
            for name in size
            if name in free and sigma[f"{name}{k}"] > 0.02 * size[name]
        ]
    return tuple(said)
