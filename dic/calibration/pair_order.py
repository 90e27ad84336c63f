"""Order of camera 1's calibration pictures that fits those of camera 0, where the pairs as given do not.

Each camera's pictures give the poses of the target in its own frame. If pictures i and j belong together,
they give the relative pose of the cameras, and with it camera 0's other poses say where camera 1 saw the
target. The relative pose under which most of these places are taken by one picture each is that of the
cameras.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from dic.arrays import FloatArray
from dic.calibration.projection import View
from dic.calibration.rig_state import Pose
from dic.calibration.start import focal_start, onward, relative, resection
from dic.calibration.views import all_views
from dic.camera import Camera

MOST_FIRST = 4
"""Pictures of camera 0 whose partners are tried."""
NEAR = 0.03
"""Places agree within this share of the picture's longer side."""
LEAST_SHARE = 0.8
"""Share of the pictures that must find a partner."""


def find_order(
    detections: tuple[Sequence[object], Sequence[object]],
    targets: Sequence[object],
    sensors: tuple[tuple[int, int], tuple[int, int]],
) -> list[int] | None:
    """Find which picture of camera 1 belongs to each of camera 0.

    Parameters
    ----------
    detections
        What each camera saw, one entry a picture, as `dic.calibration.calibrate` takes it; as many of both.
    targets
        The target of each pair.
    sensors
        Columns and rows of the two cameras' pictures [px].

    Returns
    -------
    list of int or None
        A picture of camera 1 for each of camera 0, every one once; pictures without a detection take what is
        left. None if no order fits `LEAST_SHARE` of them.
    """
    views = all_views(detections, targets)  # type: ignore[arg-type]
    own: list[dict[int, View]] = [
        {k: v[0] for (k, c), v in views.items() if c == camera} for camera in (0, 1)
    ]
    if min(len(own[0]), len(own[1])) < 3:
        return None
    cameras = [focal_start(sensors[c], [view for _, view in sorted(own[c].items())]) for c in (0, 1)]
    poses = [{k: resection(cameras[c], view) for k, view in own[c].items()} for c in (0, 1)]
    first, second = ([k for k in sorted(p) if p[k]] for p in poses)
    if not first or not second:
        return None
    centres = np.array([own[1][j].pixels.mean(axis=0) for j in second])
    limit = NEAR * max(sensors[1])
    best: tuple[int, float, FloatArray, FloatArray] | None = None
    for i in first[:MOST_FIRST]:
        for j in second:
            for p in poses[0][i]:
                for q in poses[1][j]:
                    places = _places(relative(p, q), cameras[1], poses[0], own[0], first)
                    away = np.linalg.norm(places[:, None] - centres, axis=2)
                    rows, columns = linear_sum_assignment(np.minimum(away, limit))
                    near = away[rows, columns] < limit
                    score = (int(near.sum()), -float(away[rows, columns][near].sum()))
                    if best is None or score > best[:2]:
                        best = (*score, rows[near], columns[near])
    if best is None or best[0] < LEAST_SHARE * min(len(first), len(second)):
        return None
    order = {first[r]: second[c] for r, c in zip(best[2], best[3], strict=True)}
    left = [j for j in range(len(detections[1])) if j not in order.values()]
    return [order[k] if k in order else left.pop(0) for k in range(len(detections[0]))]


def _places(
    rel: Pose,
    camera: Camera,
    poses: Mapping[int, list[Pose]],
    views: Mapping[int, View],
    wanted: Sequence[int],
) -> FloatArray:
    """Where camera 1 would see the middle of the target in camera 0's pictures [px], shape [n, 2]."""
    middles = np.array([poses[k][0][0] @ views[k].points.mean(axis=0) + poses[k][0][1] for k in wanted])
    moved, camera = onward((np.eye(3), np.zeros(3)), rel), replace(camera, rotation=np.eye(3))
    return np.asarray(camera.project(middles @ moved[0].T + moved[1]))
