"""Synthetic specimens of the tables H: sizes [mm], shear moduli and constants [kPa], compressions
recorded."""

import numpy as np

POISSON = 0.495  # at rest; K = 2 mu (1 + nu) / (3 (1 - 2 nu)), U = K/2 (J - 1)^2
SPECIMENS = {
    "yeoh": (9.5, 6.5, 28.0, {"C10": 14.0, "C20": 2.0, "C30": 0.5}),
    "ogden2": (10.0, 8.0, 26.0, {"mu1": 18.0, "alpha1": 3.5, "mu2": 8.0, "alpha2": -2.0}),
    "mooney_rivlin": (9.5, 6.5, 28.0, {"C10": 9.0, "C01": 5.0}),
    "reduced_polynomial": (80.0, 70.0, 2.8098, {"C10": 1.4049, "C20": 0.6994}),
}
"""Law -> diameter, length, shear modulus at rest, constants by the names of `explicit.materials.LAWS`."""
"""The last is the silicone of the thesis, Table 3.3: 80 mm by 70 mm, 10 mm of compression, f = 0.7."""


def strains(law: str) -> np.ndarray:
    """Compressions that are recorded [-]."""
    if law == "reduced_polynomial":
        return np.linspace(0.5, 10.0, 20) / 70.0
    return np.round(np.arange(0.02, 0.5001, 0.02), 4)
