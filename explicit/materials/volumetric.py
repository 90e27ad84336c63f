"""The volumetric law U_vol = K/2 (J - 1)^2 and its modulus."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

POISSON_LIMIT = 0.49999
"""Largest Poisson's ratio: beyond it nothing changes but the step, see `explicit.incompressible`."""


def bulk_modulus(shear_modulus: FloatArray | float, poisson: FloatArray | float) -> FloatArray:
    """Bulk modulus of the initial state, K = 2 mu_0 (1 + nu) / (3 (1 - 2 nu)) [Pa].

    Raises
    ------
    ValueError
        If a Poisson ratio is outside [0, 0.49999].
    """
    nu = np.asarray(poisson, dtype=float)
    if not ((nu >= 0.0) & (nu <= POISSON_LIMIT)).all():
        worst = nu[~((nu >= 0.0) & (nu <= POISSON_LIMIT))].flat[0]
        raise ValueError(
            f"poisson must be in [0, {POISSON_LIMIT}], got {worst}: an explicit run needs slight "
            "compressibility; 0.499 stands for an incompressible elastomer"
        )
    return 2.0 * np.asarray(shear_modulus) * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
