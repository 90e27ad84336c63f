"""Refinement of the cameras' relative pose from the speckles, where [calibration] asks for it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.bodies.region import grid_points
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.images import PictureError, Pictures
from kolsky.shot.schema.pictures import CalibrationSection


def refined(
    section: CalibrationSection,
    rig: StereoRig,
    pictures: Sequence[Pictures],
    frame: int,
    mask: NDArray[np.bool_],
    settings: Correlation,
    *,
    step: int,
    noise: float | None = None,
    device: str = "cpu",
) -> tuple[StereoRig, dict[str, Any]]:
    """The cameras, refined from one pair of pictures if [calibration] asks for it, and what came out.

    With ``refine = true`` the refined pose is taken, with ``"auto"`` where it helps on points it was not
    fitted to (`dic.calibration.refine`); without either nothing is looked at. Where too few points are
    matched the cameras stay as they are, and the facts say so.

    Parameters
    ----------
    section
        The table.
    rig
        The cameras, for the pictures as cropped.
    pictures
        The series of both cameras.
    frame
        The frame whose pair is matched.
    mask
        Pixels of the body in camera 0's picture, shape [rows, columns].
    settings
        Of the match.
    step
        Distance of the points [px].
    noise
        Standard deviation of a grey value [grey]; None: 1 % of the picture's contrast.
    device
        Where pictures are correlated.
    """
    if section.refine is False:
        return rig, {}
    from dic.calibration.refine import refine_from_pictures

    asked = {"asked": "auto" if section.refine == "auto" else "yes"}
    try:
        pair = (pictures[0].frame(frame), pictures[1].frame(frame))
        sigma = [0.01 * float(np.std(one)) if noise is None else noise for one in pair]
        points, _ = grid_points(mask, step, margin=2.0)
        found = refine_from_pictures(
            pair, rig, points, settings, noise=(Noise(sigma[0]), Noise(sigma[1])), mask=mask, device=device
        )
    except (PictureError, ValueError) as error:
        return rig, {**asked, "used": False, "why": str(error)}
    used = section.refine is True or found.helps
    return (found.rig if used else rig), {**asked, "used": used, **found.words}


def refinement_words(facts: Mapping[str, Any]) -> str:
    """A line on the refinement for a terminal and a page; empty if none was asked for."""
    if not facts:
        return ""
    if "why" in facts:
        return f"not possible: {facts['why']}"
    before, after = facts["epipolar_median_before_px"], facts["epipolar_median_after_px"]
    return (
        f"{'used' if facts['used'] else 'not used'}: epipolar median {before:.4f} px by the calibration, "
        f"{after:.4f} px refined ({facts['held_out_before_px']:.4f} and {facts['held_out_after_px']:.4f} px "
        "on points left out)"
    )
