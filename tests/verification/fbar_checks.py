"""Both elements one at a time: patch, gradient, energy, closed form, step bound; and what is allowed."""

from dataclasses import dataclass
from functools import cache

import dynamic_bonded as dynamic
import energy
import frictionless
import numpy as np
import patch
from fbar_element import BETA, Bound, bound_quality, gradient_errors
from fbar_runs import ELEMENTS
from numpy.typing import NDArray
from scene import shear_modulus

from explicit.materials import neo_hookean

FloatArray = NDArray[np.float64]

POISSON = (0.3, 0.495, 0.4999)
"""Poisson's ratios of the step bound's study [-]."""
STATIC_TOLERANCE = {"coarse": 0.03, "fine": 0.01}
"""Allowed relative force error [-]: first order at the bonded edges, 2.3 % at 20 % on 16 × 22; the
reference's own 0.3 % at 20 % is in it."""
RADIUS_TOLERANCE = {"coarse": 20e-6, "fine": 10e-6}
"""Allowed error of the radius at mid-height [m], as of the one-point element."""
LIMIT_TOLERANCE = 5e-3
"""Allowed relative difference of an extrapolated static force from the reference, and of both elements' from
each other [-]: the reference's own 0.3 %, and landing nodes, which no power of h describes."""
IMPACT_TOLERANCE = {"coarse": 0.025, "fine": dynamic.FINE_TOLERANCE}
"""Allowed rms difference of the 5 kHz force over its peak [-]: dispersion of an ungraded mesh; finer, as of
the one-point element."""
AGREEMENT = 2.5e-3
"""Allowed rms difference of both elements' extrapolated 5 kHz forces over the peak [-]: half the reference's
own 0.5 %."""
BOUND_FLOOR = {"one_point": 0.95, "fbar": 1.0}
"""Least allowed quotient of step bound and largest frequency squared [-]. A bound has 1; the one-point
element's leaves out the pressure's work on rotations, and `Stepping.safety` = 0.9 (0.81 here) covers it."""


@dataclass(frozen=True)
class Single:
    """One element by itself."""

    interior: dict[str, float]
    """Patch test: largest interior force over the largest corner force, by precision [-]."""
    face: dict[str, float]
    """Largest relative error of a face force in the patch test, by precision [-]."""
    rigid: dict[str, float]
    """Largest force in a rigid shift with a rigid velocity over mu R^2, by precision [-]."""
    rate_power: float
    """Power of the damping stress in uniform stretching over its closed form, minus 1 [-]."""
    gradient: FloatArray
    """Force against the energy's central difference, by step [-], shape [n_differences]."""
    imbalance: dict[str, float]
    """Largest energy imbalance, f = 0 and 0.3, by kind of damping [-]."""
    frictionless: float
    """Largest relative force error against the closed form, two laws, three nu, 10 to 60 % [-]."""


@dataclass(frozen=True)
class Result:
    """What does not come from `fbar_runs`, whose functions the page calls itself."""

    single: dict[str, Single]
    """By element."""
    bounds: dict[tuple[str, float, str], Bound]
    """Step bound over what it bounds, by element, nu and damping."""


@cache
def single(element: str) -> Single:
    """All checks of one element by itself."""
    mesh = patch.distorted(patch.cylinder(patch.RADIUS, patch.LENGTH, n_radial=7, n_axial=9, grading=1.0))
    states = {name: patch.homogeneous(mesh, name, element) for name in patch.TOLERANCE}
    law = neo_hookean(shear_modulus(0.495))
    return Single(
        interior={name: max(found[0].values()) for name, found in states.items()},
        face={name: max(found[1].values()) for name, found in states.items()},
        rigid={name: found[2] for name, found in states.items()},
        rate_power=patch.rate_power(mesh, element),
        gradient=gradient_errors(element, law),
        imbalance={
            kind: float(energy.simulate((0.0, 0.3), kind, element=element)[1].energy.imbalance().max())
            for kind in ("deviatoric", "full")
        },
        frictionless=frictionless_error(element),
    )


def frictionless_error(element: str) -> float:
    """Largest relative force error of slow frictionless compression against the closed form [-]."""
    laws = (neo_hookean, frictionless.yeoh_like)
    materials = [make(shear_modulus(nu)) for make in laws for nu in frictionless.POISSON]
    force, _, _ = frictionless.slow_compression(
        frictionless.LOADING, materials, list(frictionless.POISSON) * 2, element=element
    )
    exact = frictionless.reference()[..., 0].reshape(force.shape)
    return float(np.abs(force / exact - 1.0).max())


@cache
def case() -> Result:
    """Both elements; the slow compressions take most of the ten minutes."""
    kinds = {"none": (0.0, "deviatoric"), "deviatoric": (BETA, "deviatoric"), "full": (BETA, "full")}
    bounds = {
        (element, nu, name): bound_quality(element, nu, beta=beta, kind=kind)
        for element in ELEMENTS
        for nu in POISSON
        for name, (beta, kind) in kinds.items()
    }
    return Result({element: single(element) for element in ELEMENTS}, bounds)
