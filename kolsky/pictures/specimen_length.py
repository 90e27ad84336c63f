"""The specimen's length from its pictures: the declared one, conditioned on the flyer's rim at rest.

At rest the flyer's face lies on the specimen's upper end. The height of its rim above the specimen's lower
end in the pictures is therefore another measurement of the length. Its difference from the declared length is

    d = b - a + z + r,

with four errors: of the declared length (a), of the outline's heights, i.e. of the lower end (b), of the
flyer's observed position at rest (z) and of the rim (r). All are independent before d is known. Given d, a
and b follow from the conditional normal distribution. The zero of the flyer's displacement is conditioned on
the same d in `dic.bodies.axial_displacement.combine_rest`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kolsky.base.arrays import FloatArray

if TYPE_CHECKING:
    from dic.result import StereoResult

REPORTED_DISAGREEMENT = 3.0
"""Difference of declared length and pictures that is reported, in standard deviations of both."""


@dataclass(frozen=True)
class RimAtRest:
    """Height of the flyer's rim above the specimen's lower end at rest."""

    disagreement: float
    """Length in the pictures minus declared length [m]."""
    sigma: float
    """Standard deviation of the height, without the lower end's contribution [m]."""


@dataclass(frozen=True)
class LengthByPictures:
    """The specimen's length: as declared, from the pictures, and as used."""

    declared: float
    """The declared length [m]."""
    declared_sigma: float
    """Its standard uncertainty [m]; 0 if it is exact."""
    pictures: float
    """The length in the pictures [m]."""
    pictures_sigma: float
    """Its standard uncertainty with that of the lower end [m]."""
    used: float
    """The length that is used [m]."""
    used_sigma: float
    """Its standard uncertainty [m]."""
    y_shift: float = 0.0
    """Correction added to the outline's heights [m]."""
    y_sigma: float = 0.0
    """Standard uncertainty of the heights for a known length [m]."""
    y_per_length: float = 0.0
    """Error of the heights per error of the length [-]."""

    @property
    def apart(self) -> float:
        """Length in the pictures minus declared length, in standard deviations of both [-]."""
        return (self.pictures - self.declared) / float(np.hypot(self.declared_sigma, self.pictures_sigma))

    @property
    def conditioned(self) -> bool:
        """True if the pictures contribute to the used length."""
        return self.used_sigma < self.declared_sigma


def rim_at_rest(
    result: StereoResult, *, length: float, length_sigma: float, unseen: float = 0.0
) -> RimAtRest | None:
    """The rim at rest in the pictures of a shot.

    None if it was not found, or if the flyer is not visible at rest. ``length``, ``length_sigma``: the
    declared length of the result and its standard uncertainty [m]. ``unseen``: standard uncertainty of the
    length in the pictures due to effects that they do not show [m]. Such effects are the pitch of the
    calibration target, and faces that are not parallel.
    """
    axial = result.axial_displacement
    if axial is None or axial.rim_disagreement is None:
        return None
    lower = float(result.placement.frame.covariance[4, 4])
    more = calibration_variance(result, length) + unseen**2
    return rim_of(axial.rim_disagreement, length_sigma=length_sigma, lower_variance=lower, more=more)


def rim_of(
    disagreement: tuple[float, float], *, length_sigma: float, lower_variance: float, more: float = 0.0
) -> RimAtRest:
    """The rim at rest with the uncertainty of its position.

    ``disagreement``: length in the pictures minus declared length, and its standard deviation [m]. The latter
    includes those of the declared length and of the lower end. ``length_sigma``: standard uncertainty of the
    declared length [m]. ``lower_variance``: variance of the lower end's position [m²]. ``more``: variance
    that is not included in that of the disagreement [m²].
    """
    off, whole = disagreement
    return RimAtRest(off, float(np.sqrt(whole**2 - length_sigma**2 - lower_variance + more)))


def calibration_variance(result: StereoResult, length: float) -> float:
    """Variance of a length along the specimen's side by the calibration [m²]; 0 without its covariance."""
    from dic.stereo.reconstruction import calibration_slopes  # for shots with pictures only

    rig, frame = result.rig, result.placement.frame
    if rig.covariance is None:
        return 0.0
    ends = np.array([[0.0, 0.0, result.placement.radius], [0.0, length, result.placement.radius]])
    slopes: FloatArray = frame.rotation[1] @ np.diff(calibration_slopes(rig, frame.in_rig(ends)), axis=0)[0]
    return float(slopes @ rig.covariance @ slopes)


def conditioned_length(rim: RimAtRest, *, declared: float, sigma: float, y_sigma: float) -> LengthByPictures:
    """The declared length and the outline's heights, conditioned on the rim at rest.

    An exact length and its heights are not changed. They are not changed either if length and pictures
    disagree by more than `MOST_APART` standard deviations. It is then unknown which of them is wrong.

    ``declared``, ``sigma``: the declared length and its standard uncertainty [m]. ``y_sigma``: standard
    uncertainty of the outline's heights, i.e. of the lower end [m].
    """
    from dic.bodies.axial_displacement import MOST_APART  # for shots with pictures only

    found = LengthByPictures(
        declared=declared,
        declared_sigma=sigma,
        pictures=declared + rim.disagreement,
        pictures_sigma=float(np.hypot(rim.sigma, y_sigma)),
        used=declared,
        used_sigma=sigma,
        y_sigma=y_sigma,
    )
    if sigma == 0.0 or abs(found.apart) > MOST_APART:
        return found
    whole = sigma**2 + found.pictures_sigma**2
    return replace(
        found,
        used=declared + sigma**2 / whole * rim.disagreement,
        used_sigma=sigma * found.pictures_sigma / float(np.sqrt(whole)),
        y_shift=-(y_sigma**2) / whole * rim.disagreement,
        y_sigma=y_sigma * rim.sigma / found.pictures_sigma,
        y_per_length=(y_sigma / found.pictures_sigma) ** 2,
    )


def length_words(found: LengthByPictures) -> str:
    """Declared, measured and used length as text, each with its k = 2 uncertainty."""

    def one(value: float, sigma: float) -> str:
        return f"{1e3 * value:.4f} mm ± {2e6 * sigma:.1f} µm"

    declared = f"declared {one(found.declared, found.declared_sigma)}"
    seen = f"in the pictures {one(found.pictures, found.pictures_sigma)}"
    used = f"used {one(found.used, found.used_sigma)}" if found.conditioned else "used as declared"
    return f"{declared}, {seen}, {used} (k = 2)"


def length_notes(found: LengthByPictures) -> tuple[str, ...]:
    """Note on a declared length that contradicts the pictures, with the remedy."""
    if abs(found.apart) <= REPORTED_DISAGREEMENT:
        return ()
    used = f"{1e3 * found.used:.4f} mm was used" if found.conditioned else "the declared one was used"
    return (
        f"specimen.length is {1e3 * found.declared:.4f} mm, and the pictures prefer "
        f"{1e3 * found.pictures:.4f} mm ± {2e6 * found.pictures_sigma:.1f} µm (k = 2), "
        f"{abs(found.apart):.1f} standard uncertainties of both away; {used}: measure the specimen again, "
        "and check the pitch of the calibration target, the crop offsets, and whether the flyer touched the "
        "specimen at rest",
    )
