"""Specimens of the tables I: sizes [mm], shear moduli and constants [kPa], compressions recorded."""

import numpy as np

POISSON = 0.495  # at rest; K = 2 mu (1 + nu) / (3 (1 - 2 nu)), U = K/2 (J - 1)^2, D1 = 2 / K
SPECIMENS = {
    "neo_hookean": (9.5, 6.5, 80.0 / 2.99, {"C10": 40.0 / 2.99}),
    "yeoh": (9.5, 6.5, 28.0, {"C10": 14.0, "C20": 2.0, "C30": 0.5}),
    "ogden2": (10.0, 8.0, 26.0, {"mu1": 18.0, "alpha1": 3.5, "mu2": 8.0, "alpha2": -2.0}),
    "mooney_rivlin": (9.5, 6.5, 28.0, {"C10": 9.0, "C01": 5.0}),
    "yeoh_b": (12.0, 7.0, 40.0, {"C10": 20.0, "C20": -1.5, "C30": 0.8}),
    "ogden2_b": (8.0, 6.0, 30.0, {"mu1": 24.0, "alpha1": 2.4, "mu2": 6.0, "alpha2": -3.0}),
    "mooney_rivlin_b": (10.0, 6.0, 20.0, {"C10": 8.0, "C01": 2.0}),
    "yeoh_c": (11.0, 9.0, 20.0, {"C10": 10.0, "C20": 4.0, "C30": 0.2}),
    "ogden2_c": (12.7, 6.35, 22.0, {"mu1": 12.0, "alpha1": 5.0, "mu2": 10.0, "alpha2": -1.0}),
    "mooney_rivlin_c": (9.0, 9.0, 20.0, {"C10": 4.0, "C01": 6.0}),
    "reduced_polynomial": (80.0, 70.0, 2.8098, {"C10": 1.4049, "C20": 0.6994}),
}
"""Name -> diameter, length, shear modulus at rest, constants by the names of `explicit.materials.LAWS`. The
first is that of the tables A and G, the next three are those of H; what was chosen in the correction was
chosen on these four. Those of b and c were made afterwards. The last is the silicone of the thesis, Table
3.3, to 10 mm with f = 0.7."""


def strains(name: str) -> np.ndarray:
    """Compressions that are recorded [-]."""
    if name == "reduced_polynomial":
        return np.round(np.linspace(0.5, 10.0, 20) / 70.0, 12)
    return np.round(np.arange(0.02, 0.5001, 0.02), 4)
