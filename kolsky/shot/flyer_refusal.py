"""Why a flyer's displacement is not known from its pictures, and what to do about it."""

import numpy as np

from dic.result import StereoResult
from dic.rigid_body.rest_from_rim import LARGEST_SHARE


def why_unknown(result: StereoResult, length: float, length_sigma: float) -> tuple[str, str]:
    """What kept the flyer's displacement from being known, and the cure, each after the key of its region.

    Parameters
    ----------
    result
        What the pictures gave, without a displacement of the flyer.
    length
        Of the specimen at rest [m].
    length_sigma
        Its declared standard uncertainty [m].
    """
    seen = np.zeros(0, dtype=np.int64) if result.flyer is None else np.flatnonzero(result.flyer.n_valid)
    if not seen.size:
        return (
            "shows no point that both cameras see, so how far it went is not known",
            "declare a region that both cameras see, in a frame that shows much of it; if there is none, "
            "check crop_offset and the calibration of both cameras",
        )
    first = f"is first seen by both cameras in frame {seen[0]}, after it moved"
    lower = float(np.sqrt(result.placement.frame.covariance[4, 4]))
    known, allowed = float(np.hypot(length_sigma, lower)), LARGEST_SHARE * length
    if known > allowed:
        return (
            f"{first}; its place at rest is the specimen's upper end, which by length "
            f"({1e6 * length_sigma:.1f} um) and lower end ({1e6 * lower:.1f} um) is known to "
            f"{1e6 * known:.1f} um, allowed {1e6 * allowed:.1f} um",
            "measure the length to 0.1 % and declare it in uncertainty.specimen_length, or set the cameras "
            "so that both show the flyer at rest",
        )
    return (
        f"{first}, and the rim of its face, which would tell where it was, is not clear in enough frames, "
        "or the cameras put it too far apart",
        "declare a region that ends 2 to 8 pixels before the edge of its face, in a frame that shows much of "
        "it, or set the cameras so that both show the flyer at rest",
    )
