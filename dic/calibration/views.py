"""Between what detections say and what the solve works with."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dic.calibration.projection import View, seen
from dic.calibration.result import PairView
from dic.calibration.rig_state import Rig
from dic.calibration.targets.base import Detection, Target


def all_views(
    detections: tuple[Sequence[object], Sequence[object]], targets: Sequence[Target]
) -> dict[tuple[int, int], list[View]]:
    """(pair, camera) -> its view, once in each numbering of the target that looks the same.

    Camera 0 says which numbering a pair has, so it is listed in the first one alone if both saw the target.
    """
    geometries = {id(target): target.geometry() for target in targets}
    views: dict[tuple[int, int], list[View]] = {}
    for camera, own in enumerate(detections):
        for pair, view in enumerate(own):
            if not isinstance(view, Detection):
                continue
            g = geometries[id(targets[pair])]
            if len(view.ids) and (view.ids.min() < 0 or view.ids.max() >= len(g.points)):
                raise ValueError(
                    f"pair {pair}, camera {camera}: ids must lie in 0 to {len(g.points) - 1} for this target"
                )
            numberings = g.equivalents if camera == 1 else g.equivalents[:1]
            views[pair, camera] = [
                View(
                    pair,
                    camera,
                    ids,
                    g.points[ids],
                    g.normals[ids],
                    g.spread[ids],
                    g.bend[ids],
                    view.pixels,
                    view.sigma,
                )
                for ids in (numbering[view.ids] for numbering in numberings)
            ]
    return views


def finished_view(rig: Rig, view: View, used: NDArray[np.bool_]) -> PairView:
    """The record of one view in a solved rig."""
    R, t = rig.poses[view.pair]
    camera = rig.cameras[view.camera]
    expected = seen(camera, view, R, t)
    shift = expected - seen(camera, view, R, t, patches=False)
    return PairView(view.ids, view.pixels, view.sigma, view.pixels - expected, shift, used)


def only(view: View, rows: NDArray[np.bool_]) -> View:
    """Some of a view's points."""
    return View(
        view.pair,
        view.camera,
        view.ids[rows],
        view.points[rows],
        view.normals[rows],
        view.spread[rows],
        view.bend[rows],
        view.pixels[rows],
        view.sigma[rows],
    )
