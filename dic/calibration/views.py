"""Between what detections say and what the solve works with."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dic.calibration.bundle import Rig
from dic.calibration.projection import Sight, seen
from dic.calibration.result import Sighting
from dic.calibration.targets.base import Detection, Target


def all_sights(
    views: tuple[Sequence[object], Sequence[object]], targets: Sequence[Target]
) -> dict[tuple[int, int], list[Sight]]:
    """(pair, camera) -> its view, once in each numbering of the target that looks the same.

    Camera 0 says which numbering a pair has, so it is listed in the first one alone if both saw the target.
    """
    geometries = {id(target): target.geometry() for target in targets}
    sights: dict[tuple[int, int], list[Sight]] = {}
    for camera, own in enumerate(views):
        for pair, view in enumerate(own):
            if not isinstance(view, Detection):
                continue
            g = geometries[id(targets[pair])]
            if len(view.ids) and (view.ids.min() < 0 or view.ids.max() >= len(g.points)):
                raise ValueError(
                    f"pair {pair}, camera {camera}: ids must lie in 0 to {len(g.points) - 1} for this target"
                )
            numberings = g.equivalents if camera == 1 else g.equivalents[:1]
            sights[pair, camera] = [
                Sight(
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
    return sights


def finished_view(rig: Rig, sight: Sight, used: NDArray[np.bool_]) -> Sighting:
    """The record of one view in a solved rig."""
    R, t = rig.poses[sight.pair]
    camera = rig.cameras[sight.camera]
    expected = seen(camera, sight, R, t)
    shift = expected - seen(camera, sight, R, t, patches=False)
    return Sighting(sight.ids, sight.pixels, sight.sigma, sight.pixels - expected, shift, used)


def only(sight: Sight, rows: NDArray[np.bool_]) -> Sight:
    """Some of a view's points."""
    return Sight(
        sight.pair,
        sight.camera,
        sight.ids[rows],
        sight.points[rows],
        sight.normals[rows],
        sight.spread[rows],
        sight.bend[rows],
        sight.pixels[rows],
        sight.sigma[rows],
    )
