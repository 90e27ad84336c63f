"""States of strain for the tests of every law, and its twin from the principal axes."""

import numpy as np

from explicit.materials.law import Stretches, isochoric, kirchhoff, tangent


def stretches(n: int, largest: float = 0.5, seed: int = 7) -> np.ndarray:
    """Isochoric principal stretches with logarithms up to `largest`, shape [n, 3]."""
    rng = np.random.default_rng(seed)
    return isochoric(np.exp(rng.uniform(-largest, largest, (n, 3))))


def turned(values: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Rotated tensors (rr, yy, ry, tt) with principal values 0 and 1 in the plane, shape [..., 4]."""
    mean, half = 0.5 * (values[..., 0] + values[..., 1]), 0.5 * (values[..., 0] - values[..., 1])
    c, s = np.cos(2.0 * np.asarray(angle)), np.sin(2.0 * np.asarray(angle))
    return np.stack([mean + half * c, mean - half * c, half * s, values[..., 2]], axis=-1)


def largest_curvature(law: Stretches, stretch: np.ndarray) -> np.ndarray:
    """Largest ratio of the second variation of W to |L|^2 along F + eps L F [Pa], shape [...].

    It is exact: the largest eigenvalue of its blocks, one of the stretches and three of shear. The kernels'
    tangent bounds it for the stable step. The stretches, of shape [..., 3], must differ.
    """
    lam = isochoric(stretch)
    square, tau = lam**2, kirchhoff(law, lam)
    block = tangent(law, lam) - np.eye(3) * tau[..., None]
    most = [np.linalg.eigvalsh(block)[..., -1]]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        G = (tau[..., i] - tau[..., j]) / (square[..., i] - square[..., j])
        mean, apart = 0.5 * G * (square[..., i] + square[..., j]), 0.5 * G * (square[..., i] - square[..., j])
        most.append(mean + np.hypot(apart, G * square[..., j] - tau[..., j]))
    return np.asarray(np.max(most, axis=0))
