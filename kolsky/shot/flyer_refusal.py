"""Why a flyer's displacement is not known from its pictures, and what to do about it."""

import numpy as np

from dic.result import StereoResult
from dic.rigid_body.rest_from_rim import LARGEST_SHARE

LEAST_SUBSET = 11
"""Smallest subset that is proposed [px]: a smaller one holds too few speckles."""


def why_unknown(
    result: StereoResult, length: float, length_sigma: float, subset: int = LEAST_SUBSET
) -> tuple[str, str]:
    """What kept the flyer's displacement from being known, and the cure, each after the key of its region.

    Parameters
    ----------
    result
        What the pictures gave, without a displacement of the flyer.
    length
        Of the specimen at rest [m].
    length_sigma
        Its declared standard uncertainty [m].
    subset
        Side of the subsets [px]: where the flyer's region is narrower, one that fits is the first cure.
    """
    seen = np.zeros(0, dtype=np.int64) if result.flyer is None else np.flatnonzero(result.flyer.n_valid)
    if not seen.size:
        return (
            "shows no point that both cameras see, so how far it went is not known",
            f"{_smaller_subset(result, subset)}declare a region that both cameras see, in a frame that shows "
            "much of it; if there is none, check crop_offset and the calibration of both cameras",
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


def _smaller_subset(result: StereoResult, subset: int) -> str:
    """The cure of a region that is narrower than a subset, as a sentence begins; empty if it is not."""
    corners = np.array(result.facts.get("regions", {}).get("flyer", np.zeros((0, 2))), dtype=np.float64)
    if not corners.size:
        return ""
    across = int(np.ptp(corners, axis=0).min()) + 1
    fitting = max(across - 1 + across % 2, LEAST_SUBSET)  # odd
    if fitting >= subset:
        return ""
    return (
        f"set `subset = {fitting}` in [dic], as its region is {across} px across and a subset {subset}; or "
    )
