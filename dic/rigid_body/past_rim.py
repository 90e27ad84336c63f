"""Region of the flyer that reaches past the rim of its face.

A camera that stands below the face sees it at a glance between the rim and the specimen. The face moves with
the flyer, so that no motion tells it from the side, and a region found or drawn may hold some of it; but the
other camera sees specimen at the same places of the cylinder. Where much of the flyer is in view that is one
row of many; at rest, with a few rows in view, it moves the match by half a pixel.
"""

import numpy as np

from dic.arrays import BoolArray, FloatArray
from dic.camera import Camera
from dic.rigid_body.edge_pixels import rays_on_body
from dic.stereo.rays import pixels_per_length
from dic.surfaces import SpecimenFrame

CLEAR = 1.0
"""Distance from the rim at which what is left of such a region ends, as one that is found does: the blur of
the edge [px]."""


def before_rim(
    mask: BoolArray, camera: Camera, frame: SpecimenFrame, radius: float, move: FloatArray, rim: float
) -> tuple[BoolArray, float]:
    """Pixels of a region that show the flyer's side clear of its rim, if some of it lie past the rim.

    Parameters
    ----------
    mask
        Pixels of the region in the material picture, shape [rows, columns].
    camera, frame
        The camera of that picture, and the test frame.
    radius
        Of the flyer [m].
    move
        Its translation in that picture [m], shape [3].
    rim
        y of the rim at translation zero [m].

    Returns
    -------
    array of bool
        The pixels, shape [rows, columns]: all of the region if none of their centres lies past the rim,
        otherwise those that are `CLEAR` of it.
    float
        How far the region reaches past the rim along the axis [px]; 0: it does not.
    """
    row, column = np.nonzero(mask)
    pixels = np.stack([column, row], axis=1).astype(np.float64)
    moved = np.array([move[0], 0.0, move[2]])
    y = rays_on_body(camera, pixels, frame, radius, moved)[:, 1] - move[1]
    place = frame.in_rig(np.array([0.0, rim, radius]) + move)
    scale = float(np.linalg.norm(pixels_per_length(camera, place, frame.rotation[1])))
    past = float(np.max((rim - y) * scale, initial=0.0, where=np.isfinite(y)))
    if past <= 0.0:
        return mask, 0.0
    kept = mask.copy()
    kept[row, column] = (y - rim) * scale >= CLEAR  # a ray that misses the flyer has no y, and is left out
    return kept, past
