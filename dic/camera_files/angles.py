"""The angles that VIC-3D, DICe and MatchID write: R = Rz(γ) Ry(β) Rx(α), in degrees."""

import numpy as np

from dic.arrays import FloatArray


def rotation_of(alpha: float, beta: float, gamma: float) -> FloatArray:
    """R = Rz(gamma) Ry(beta) Rx(alpha) of angles in degrees, shape [3, 3]."""
    (cx, cy, cz), (sx, sy, sz) = (f(np.deg2rad([alpha, beta, gamma])) for f in (np.cos, np.sin))
    return np.array(
        [
            [cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz],
            [cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz],
            [-sy, sx * cy, cx * cy],
        ]
    )


def angles_of(R: FloatArray) -> tuple[float, float, float]:
    """Alpha, beta, gamma [degrees] of a rotation; gamma is 0 where beta is ±90° and only their sum counts."""
    level = np.hypot(R[0, 0], R[1, 0])
    beta = np.arctan2(-R[2, 0], level)
    if level > 1e-12:
        alpha, gamma = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    else:
        alpha, gamma = np.arctan2(-R[1, 2], R[1, 1]), 0.0
    a, b, c = np.rad2deg([alpha, beta, gamma])
    return float(a), float(b), float(c)
