"""Start of the bundle adjustment: focal lengths, poses and the two cameras' relative pose."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dic.calibration.projection import View, seen
from dic.calibration.rig_state import Pose, Rig, Undetermined, residuals
from dic.camera import Camera
from dic.opencv import cv2

FOCAL = (0.3, 60.0)
"""Focal lengths that are tried, over the longer side of the picture."""
TRIED = 6
"""Pictures the focal length is chosen by, and pairs whose relative pose is tried."""


def resection(camera: Camera, view: View) -> list[Pose]:
    """Poses of a target in a camera's own frame, best first; two where a flat target leaves both open."""
    return [pose for _, pose in resected(camera, view)]


def resected(camera: Camera, view: View) -> list[tuple[float, Pose]]:
    """The poses of `resection`, each after its `misfit` [px]."""
    pixels = camera.undistort(view.pixels)
    points = np.ascontiguousarray(view.points)
    flat = np.ptp(points[:, 2]) == 0.0
    if len(points) < (4 if flat else 6):
        return []
    shift = points.mean(axis=0) * [1.0, 1.0, 0.0] + [0.0, 0.0, points[0, 2] if flat else 0.0]
    method = cv2.SOLVEPNP_IPPE if flat else cv2.SOLVEPNP_SQPNP
    try:
        found, turns, shifts, _ = cv2.solvePnPGeneric(points - shift, pixels, np.eye(3), None, flags=method)
    except cv2.error:  # points on a line
        return []
    poses: list[Pose] = []
    for turn, translation in zip(turns[:found], shifts[:found], strict=True):
        R = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
        t = translation.ravel() - R @ shift
        if np.all(np.isfinite(R)) and np.all(np.isfinite(t)) and t[2] + (R @ shift)[2] > 0.0:
            poses.append((R, t))
    return sorted(((misfit(camera, view, pose), pose) for pose in poses), key=lambda found: found[0])


def misfit(camera: Camera, view: View, pose: Pose) -> float:
    """Root mean square distance of what was seen from a pose's prediction [px]."""
    off = view.pixels - seen(camera, view, *pose)
    value = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    return value if np.isfinite(value) else np.inf


def lone(camera: Camera) -> Camera:
    """The camera in its own frame."""
    return replace(camera, rotation=np.eye(3), translation=np.zeros(3))


def focal_start(sensor: tuple[int, int], views: Sequence[View]) -> Camera:
    """A camera without distortion, its principal point in the middle of the picture.

    The focal length is that of least median misfit over a few pictures, from a scan: it cannot run away, as
    the closed form from homographies does with a long lens and nearly parallel boards.

    Raises
    ------
    Undetermined
        If no pose explains any picture.
    """
    middle = (0.5 * (sensor[0] - 1), 0.5 * (sensor[1] - 1))
    few = [views[k] for k in np.unique(np.linspace(0, len(views) - 1, TRIED).round().astype(int))]

    def off(logarithm: float) -> float:
        f = float(np.exp(logarithm)) * max(sensor)
        camera = Camera(fx=f, fy=f, cx=middle[0], cy=middle[1], sensor=sensor)
        best = [next((value for value, _ in resected(camera, s)), np.inf) for s in few]
        return float(np.median(best))

    low, high = np.log(FOCAL)
    grid = np.linspace(low, high, 16)
    values = [off(x) for x in grid]
    best = int(np.argmin(values))
    if not np.isfinite(values[best]):
        raise Undetermined("no pose of the target explains what is seen; check its columns, rows and pitch")
    a, b = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    fine = np.linspace(a, b, 7)
    f = float(np.exp(fine[int(np.argmin([off(x) for x in fine]))])) * max(sensor)
    return Camera(fx=f, fy=f, cx=middle[0], cy=middle[1], sensor=sensor)


def relative(first: Pose, second: Pose) -> Pose:
    """From camera 0 to camera 1, if the same target has these poses in the two."""
    R = second[0] @ first[0].T
    return R, second[1] - R @ first[1]


def onward(first: Pose, rel: Pose) -> Pose:
    """A pose in camera 0's frame, in camera 1's."""
    return rel[0] @ first[0], rel[0] @ first[1] + rel[1]


def start(
    sensors: tuple[tuple[int, int], tuple[int, int]],
    views: Mapping[tuple[int, int], Sequence[View]],
) -> tuple[Rig, dict[tuple[int, int], View]]:
    """Cameras, relative pose and the target's poses, and which of its equivalent numberings each view has.

    Parameters
    ----------
    sensors
        Columns and rows of the two cameras' pictures [px].
    views
        (pair, camera) -> the view, once in each equivalent numbering.

    Raises
    ------
    Undetermined
        If a camera saw nothing, or no target was seen by both.
    """
    cameras = []
    for camera in (0, 1):
        own = [views[0] for (_, k), views in sorted(views.items(), key=lambda i: i[0]) if k == camera]
        if not own:
            raise Undetermined(f"camera {camera} has no picture in which the target was recognised")
        cameras.append(focal_start(sensors[camera], own))
    pairs = sorted({pair for pair, _ in views})
    joint = [pair for pair in pairs if (pair, 0) in views and (pair, 1) in views]
    if not joint:
        raise Undetermined("no target was recognised by both cameras in the same pair of pictures")
    poses = {pair: resection(cameras[0], views[pair, 0][0]) if (pair, 0) in views else [] for pair in pairs}
    rel = _relative(cameras[0], cameras[1], joint, poses, views)
    rig_cameras = (cameras[0], replace(cameras[1], rotation=rel[0], translation=rel[1]))
    chosen: dict[tuple[int, int], View] = {}
    found: dict[int, Pose] = {}
    for pair in pairs:
        options = poses[pair]
        if (pair, 0) not in views:  # seen by camera 1 alone: its pose, carried back
            back = (rel[0].T, -rel[0].T @ rel[1])
            options = [onward(p, back) for p in resection(cameras[1], views[pair, 1][0])]
        if not options:
            continue
        if (pair, 0) in views:
            chosen[pair, 0] = views[pair, 0][0]
        numberings = views.get((pair, 1), ())
        if not numberings:
            found[pair] = options[0]
            continue
        scores = [
            (misfit(cameras[1], view, onward(p, rel)), k, j)
            for k, view in enumerate(numberings)
            for j, p in enumerate(options)
        ]
        _, k, j = min(scores)
        chosen[pair, 1], found[pair] = numberings[k], options[j]
    return Rig(rig_cameras, found), chosen


def _relative(
    first: Camera,
    second: Camera,
    joint: Sequence[int],
    poses: Mapping[int, Sequence[Pose]],
    views: Mapping[tuple[int, int], Sequence[View]],
) -> Pose:
    """The relative pose that explains most pairs: a flat board leaves two tilts open in each picture."""
    few = [joint[k] for k in np.unique(np.linspace(0, len(joint) - 1, TRIED).round().astype(int))]
    candidates = [
        relative(p, q)
        for pair in few
        for view in views[pair, 1]
        for q in resection(second, view)
        for p in poses[pair]
    ]

    def off(rel: Pose) -> float:
        best = [
            min(
                (misfit(second, view, onward(p, rel)) for view in views[pair, 1] for p in poses[pair]),
                default=np.inf,
            )
            for pair in few
        ]
        return float(np.median(best))

    scores = [off(rel) for rel in candidates]
    if not scores or not np.isfinite(min(scores)):
        raise Undetermined("no relative pose of the cameras explains what they see; are pairs in order?")
    return candidates[int(np.argmin(scores))]


def rms(rig: Rig, views: Sequence[View]) -> float:
    """Root mean square distance of all that was seen from its prediction [px]."""
    off = np.concatenate([residuals(rig, view) for view in views])
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
