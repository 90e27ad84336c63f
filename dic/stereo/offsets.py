"""The crop offset that a rig would need for its epipolar distances to vanish.

A picture cropped at another place of the sensor than its calibration was told shows every point δ pixels
away. The epipolar distance feels most of that across the epipolar lines; along them it feels only what
perspective and lens distortion vary over the field. So δ is sought by least squares (Gauss-Newton on
`epipolar_distance`, points that do not fit weighted down by Cauchy's function), and a component that the
points do not determine is left at zero.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import StereoRig
from dic.robust import MAD
from dic.stereo.epipolar import epipolar_slopes

POINTS = 4000
"""Point pairs that are used at most, evenly taken from all."""
INDEPENDENT = 100
"""Points that count at most for a standard deviation: neighbours share the errors of the calibration."""
DETERMINED = 8.0
"""Standard deviation up to which a component is determined [px]."""
SURE, LEAST_FAINT = 3.5, 4.0
"""An offset along the epipolar lines is at least so many standard deviations and pixels [-, px]."""
CALIBRATED = 2.0
"""Standard deviation of such an offset that a good calibration leaves [px]."""
GONE = 0.5
"""Most of the distances that it may leave, as a share."""
FARTHEST = 4096.0
"""Offset up to which one is sought [px]: the side of a large sensor."""

HYPOTHESES = {
    "camera 1": np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
    "both cameras": np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
}
"""Pixels that a wrong offset shifts: (x0, y0, x1, y1) per (dx, dy). One of camera 0 alone is, for the
epipolar distances, the opposite one of camera 1."""


@dataclass(frozen=True)
class Offset:
    """A crop offset that explains the epipolar distances, or does not."""

    where: str
    """A key of `HYPOTHESES`."""
    value: FloatArray
    """Shift to be added to the crop offset (x, y), whole pixels [px]; 0 where not determined."""
    sigma: FloatArray
    """Standard deviation of each component, from the scatter that is left [px]; infinite if held at 0."""
    before: float
    """Median absolute epipolar distance as it is [px]."""
    after: float
    """The same with the offset added [px]."""

    @property
    def shifts(self) -> tuple[FloatArray, FloatArray]:
        """Shifts to be added to the pixels of camera 0 and of camera 1 [px]."""
        both = HYPOTHESES[self.where] @ self.value
        return both[:2], both[2:]


def find_offset(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, where: str) -> Offset:
    """The whole-pixel crop offset under which the epipolar distances are least.

    Parameters
    ----------
    rig
        The cameras, with the crop that is doubted.
    pixels0, pixels1
        Point pairs (x, y) [px], shapes [n, 2], finite.
    where
        A key of `HYPOTHESES`.

    Raises
    ------
    ValueError
        Fewer than 20 pairs, a lens distortion that cannot be undone.
    """
    if len(pixels0) < 20:
        raise ValueError(f"an offset needs at least 20 point pairs, got {len(pixels0)}")
    step = -(-len(pixels0) // POINTS)
    p0, p1 = pixels0[::step], pixels1[::step]
    basis = HYPOTHESES[where]
    held = np.zeros(2, dtype=bool)
    value, sigma = _fit(rig, p0, p1, basis, held)
    held = (sigma > DETERMINED) | (np.abs(value) < 3.0 * sigma)
    if np.any(held):
        value, sigma = _fit(rig, p0, p1, basis, held)
    value = np.round(value)
    both = basis @ value
    median = [
        float(np.median(np.abs(epipolar_slopes(rig, p0 + s * both[:2], p1 + s * both[2:])[0])))
        for s in (0.0, 1.0)
    ]
    return Offset(where, value, sigma, *median)


def faint_offset(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> Offset | None:
    """An offset of one camera along the epipolar lines, from what is left of it across them.

    Rays that miss each other by hundredths of a pixel pass as calibrated, but where what they miss by varies
    over the field as perspective makes it, and half of it goes with one offset of whole pixels, the crop is
    doubted: depths, and with them all lengths, follow it.

    Parameters
    ----------
    rig, pixels0, pixels1
        As for `find_offset`.

    Returns
    -------
    Offset or None
        None if no component is `SURE` standard deviations and `LEAST_FAINT` from zero, or if too little of
        the distances goes with it.
    """
    step = -(-len(pixels0) // POINTS)
    p0, p1 = pixels0[::step], pixels1[::step]
    basis = HYPOTHESES["camera 1"]
    value, sigma = _fit(rig, p0, p1, basis, np.zeros(2, dtype=bool))
    sure = (np.abs(value) >= SURE * sigma) & (np.abs(value) >= LEAST_FAINT)
    if not np.any(sure):
        return None
    fitted = np.where(sure, np.round(value), value)  # across the lines a part of a pixel is the calibration's
    after = p1 + (basis @ fitted)[2:]
    sizes = [float(np.median(np.abs(epipolar_slopes(rig, p0, p)[0]))) for p in (p1, after)]
    if sizes[1] > GONE * sizes[0]:
        return None
    known = np.where(sure, np.hypot(sigma, CALIBRATED), np.inf)
    return Offset("camera 1", np.where(sure, fitted, 0.0), known, *sizes)


def _fit(
    rig: StereoRig, p0: FloatArray, p1: FloatArray, basis: FloatArray, held: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Offset and standard deviation, shapes [2]; 0 ± infinite where held, or where none is found."""
    value, sigma = np.zeros(2), np.full(2, np.inf)
    free = ~held
    if not np.any(free):
        return value, sigma
    for trial in range(30):
        both = basis @ value
        try:
            e, slope0, slope1 = epipolar_slopes(rig, p0 + both[:2], p1 + both[2:])
        except ValueError:  # the lens folds back there: not an offset that a picture can have
            return np.zeros(2), np.full(2, np.inf)
        J = np.concatenate([slope0, slope1], axis=-1) @ basis[:, free]
        # All points count at first, which are far off together; those that stay behind lose their weight.
        spread = 2.5 * MAD * float(np.median(np.abs(e - np.median(e)))) + 1e-9
        spread = max(spread, 2.5 * float(np.median(np.abs(e)))) if trial < 6 else spread
        weight = 1.0 / (1.0 + (e / spread) ** 2)
        normal = (J * weight[:, None]).T @ J
        move = -np.linalg.lstsq(normal, J.T @ (weight * e), rcond=1e-12)[0]
        value[free] += move
        if np.abs(value).max() > FARTHEST:
            return np.zeros(2), np.full(2, np.inf)
        if trial > 6 and np.abs(move).max() < 1e-3:
            break
    noise = MAD * float(np.median(np.abs(e))) + 1e-9
    eigen, axes = np.linalg.eigh(normal)
    covariance = (axes / np.maximum(eigen, 1e-30)) @ axes.T * max(1.0, len(e) / INDEPENDENT)
    sigma[free] = noise * np.sqrt(np.diag(covariance))
    return value, sigma
