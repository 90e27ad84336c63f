"""Checks of the flyer's travel against what does not rest on its region: its own steps, the specimen's end
and the motion of the specimen's points."""

import numpy as np

from dic.arrays import IntArray
from dic.outcome import PointOutcome, Remark
from dic.result import Body
from dic.rigid_body.axial_displacement import AxialDisplacement

SIGMAS = 5.0
"""Disagreement that is remarked on, in standard deviations."""
STEP_SHARE = 0.35
"""And, of a step from frame to frame, as a share of those around it."""
STEADY = 0.2
"""Steps before and after that differ by less than this share are a steady motion."""
AROUND = 3
"""Steps on either side that a step is compared with."""
MOST_AHEAD = 1.05
"""The specimen's fastest points move at most so many times as far as the flyer that pushes them."""
FASTEST = 95.0
"""Percentile of the points' displacements that stands for the fastest."""
FEWEST_POINTS = 10


def of_travel(axial: AxialDisplacement | None, specimen: Body) -> list[Remark]:
    """Remarks on a travel of the flyer that its steps, the specimen's end or its points contradict.

    Parameters
    ----------
    axial
        The travel; None: there is none to be checked.
    specimen
        The specimen's points.
    """
    if axial is None:
        return []
    remarks = []
    frames = uneven_steps(axial)
    if frames.size:
        listed = ", ".join(str(k) for k in frames[:10].tolist()) + (" and more" if frames.size > 10 else "")
        remarks.append(
            Remark(
                name="uneven steps of the flyer",
                text=f"up to frame {listed} (counted from 0) the flyer moved by a third less, or more, than "
                "in the frames around",
                cure="look for pictures that are missing or doubled in both series; the times after one are "
                "wrong by a frame",
            )
        )
    if axial.rim_disagreement is not None:
        off, sigma = axial.rim_disagreement
        if abs(off) > SIGMAS * sigma:
            remarks.append(
                Remark(
                    name="flyer off the specimen's end",
                    text=f"at rest the rim of the flyer's face stands {1e6 * off:.0f} ± {1e6 * sigma:.0f} µm "
                    "(k = 1) from the specimen's upper end by its declared length",
                    cure="check the specimen's length, the crop offsets of both cameras, the calibration, "
                    "the region flyer, and whether the flyer touched the specimen at rest",
                )
            )
    ahead = fastest_share(axial, specimen)
    if ahead is not None and ahead > MOST_AHEAD:
        remarks.append(
            Remark(
                name="specimen ahead of the flyer",
                text=f"the specimen's fastest points moved {ahead:.2f} times as far as the flyer that pushes "
                "them",
                cure="look where the region flyer lies in its frame: it must hold nothing of the specimen",
            )
        )
    return remarks


def uneven_steps(axial: AxialDisplacement) -> IntArray:
    """Frames that end a step unlike the steady ones before and after it.

    A step counts as speed, so that frames that were left out change nothing.
    """
    dt = np.diff(axial.t)
    speed = np.diff(axial.displacement) / dt
    noise = np.hypot(axial.sigma[1:], axial.sigma[:-1]) / dt
    found = []
    for k in range(AROUND, speed.size - AROUND):
        before = float(np.median(speed[k - AROUND : k]))
        after = float(np.median(speed[k + 1 : k + 1 + AROUND]))
        usual = 0.5 * (before + after)
        if abs(after - before) > STEADY * abs(usual):
            continue  # starting, or at rest
        if abs(speed[k] - usual) > max(STEP_SHARE * abs(usual), SIGMAS * float(noise[k])):
            found.append(int(axial.frame[k + 1]))
    return np.array(found, dtype=np.int64)


def fastest_share(axial: AxialDisplacement, specimen: Body) -> float | None:
    """Axial displacement of the specimen's fastest points over the flyer's, the median over the later half.

    The flyer pushes the specimen against a platen: no point of it moves farther than the flyer.
    """
    surface = specimen.surface
    late = axial.displacement > 0.5 * float(axial.displacement.max(initial=0.0))
    shares = []
    for frame, moved in zip(axial.frame[late].tolist(), axial.displacement[late].tolist(), strict=True):
        fine = surface.outcome[frame] == PointOutcome.VALID
        if fine.sum() >= FEWEST_POINTS and moved > 0.0:
            shares.append(float(np.percentile(-surface.u[frame, fine, 1], FASTEST)) / moved)
    return float(np.median(shares)) if shares else None
