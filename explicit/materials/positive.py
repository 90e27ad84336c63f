"""Check of a law's energy: positive where a specimen can go, whatever its constants."""

import numpy as np

from explicit.materials.law import Stretches

STRETCHES = (0.2, 5.0)
"""Stretches along the load that are looked at [-]: to 80 % compression and fivefold length."""
MODES = {
    "uniaxial deformation": (1.0, -0.5, -0.5),
    "equibiaxial deformation": (1.0, 1.0, -2.0),
    "planar deformation": (1.0, 0.0, -1.0),
}
"""Exponents of the load's stretch in each of the three, whose product is 1."""


def not_positive(law: Stretches, *, stretches: tuple[float, float] = STRETCHES) -> tuple[str, float] | None:
    """First deformation at which the energy of a law is not above 0.

    Parameters
    ----------
    law
        A closed-form law. Past locking it has no energy, and nothing is asked of it there.
    stretches : (float, float)
        Range of the stretch along the load [-].

    Returns
    -------
    (str, float) or None
        The mode of deformation, and the stretch next to 1 at which the energy is 0 or below; None if it is
        positive.
    """
    x = np.geomspace(stretches[0], stretches[1], 1201)
    x = x[np.abs(x - 1.0) > 1e-3]
    x = x[np.argsort(np.abs(np.log(x)))]
    for mode, exponents in MODES.items():
        energy = law.strain_energy(*(x**k for k in exponents))
        bad = np.flatnonzero(energy <= 0.0)  # past locking it is no number, and is not compared
        if bad.size:
            return mode, float(x[bad[0]])
    return None
