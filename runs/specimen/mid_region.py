"""The classical evaluation of only the uniform middle of a specimen, compared with a fit of the whole
specimen.

Markers in the middle give a stretch. The force over the area of the middle gives a nominal stress. A law is
fitted to these for homogeneous deformation (Schumacher and others 2020, Sec. VI-B). For a cross the area of
one arm is used, as is usual, although both arms load the middle. The study shows the error of this method.
"""

from dataclasses import dataclass

import numpy as np

from explicit.materials import LAWS
from kolsky.base.arrays import FloatArray
from kolsky.bodies.specimen_constants import Constants
from kolsky.bodies.specimen_fit import SlowTest
from kolsky.equilibrium.solution import Solution
from kolsky.material.fits.fit import Fit, fit_law
from kolsky.material.fits.homogeneous import Mode
from kolsky.material.fits.homogeneous_test import HomogeneousTest

MARKERS = 0.25
"""Distance of the markers from the middle over half the free length."""


@dataclass(frozen=True)
class MidRegion:
    """A law fitted to the middle of specimens."""

    fit: Fit
    """The fit of homogeneous deformation."""
    constants: Constants
    """The same constants for simulations of whole specimens."""


def marker_stretch(test: SlowTest, solution: Solution) -> FloatArray:
    """Mean stretch between markers at the middle, along each pull [-], shape [n, ends]."""
    shape = test.model.shape
    points = shape.mesh.points
    reach = MARKERS * (0.5 * shape.size[0] - shape.bond)
    found = []
    for axis in range(shape.ends):
        others = [other for other in range(3) if other != axis]
        near = np.abs(points[:, others]).sum(axis=1) <= np.abs(points[:, others]).sum(axis=1).min() + 1e-12
        line = np.flatnonzero(near)
        order = line[np.argsort(points[line, axis])]
        x = points[order, axis]
        moved = [np.interp(reach, x, one[order, axis]) for one in solution.displacements]
        middle = [np.interp(0.0, x, one[order, axis]) for one in solution.displacements]
        found.append(1.0 + (np.array(moved) - np.array(middle)) / reach)
    return np.stack(found, axis=-1)


def mid_region_fit(tests: list[tuple[SlowTest, FloatArray]], constants: Constants) -> MidRegion:
    """Fit a law to the middles of specimens, incompressible.

    ``tests``: tests, each with the stretch of its middle along each pull, shape [n, ends]. ``constants``: the
    law, its free constants, and the values of the fixed constants. Raises ValueError if the law cannot be
    fitted to the tests, or if it is not one of `explicit.materials`.
    """
    if constants.law not in LAWS:
        raise ValueError(f"{constants.law} has no closed form for homogeneous tests")
    homogeneous = []
    for test, stretch in tests:
        shape = test.model.shape
        width = shape.size[1] if shape.kind == "strip" else shape.arm or shape.waist or shape.size[1]
        mode = Mode.EQUIBIAXIAL if shape.ends == 2 else Mode.UNIAXIAL
        stress = test.samples.force.mean(axis=1) / (width * shape.size[2])
        homogeneous.append(HomogeneousTest(test.name, mode, stretch.mean(axis=1), stress))
    held = {
        spec.name: constants.values[spec.name]
        for spec in LAWS[constants.law].PARAMETERS
        if spec.name not in constants.free
    }
    fit = fit_law(LAWS[constants.law], homogeneous, held=held or None)
    return MidRegion(fit, Constants(constants.law, {**constants.values, **fit.values}, constants.free))
