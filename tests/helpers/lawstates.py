"""States of strain in which every law is tested, and its twin from the principal axes."""

import numpy as np

from explicit.materials import law


def stretches(n: int, largest: float = 0.5, seed: int = 7) -> np.ndarray:
    """Isochoric principal stretches, logarithms up to `largest`, shape [n, 3]."""
    rng = np.random.default_rng(seed)
    return law.isochoric(np.exp(rng.uniform(-largest, largest, (n, 3))))


def turned(values: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Tensors (rr, yy, ry, tt) with principal values 0 and 1 in the plane, turned, shape [..., 4]."""
    mean, half = 0.5 * (values[..., 0] + values[..., 1]), 0.5 * (values[..., 0] - values[..., 1])
    c, s = np.cos(2.0 * np.asarray(angle)), np.sin(2.0 * np.asarray(angle))
    return np.stack([mean + half * c, mean - half * c, half * s, values[..., 2]], axis=-1)
