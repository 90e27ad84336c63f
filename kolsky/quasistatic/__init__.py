"""Quasi-static tests of a soft material: homogeneous deformations, fits of laws, stability."""

from kolsky.quasistatic.fits import Fit, FitOutcome, fit
from kolsky.quasistatic.homogeneous import compressible_stress, free_stretch, incompressible_stress
from kolsky.quasistatic.modes import Mode, mode_named
from kolsky.quasistatic.residuals import Weighting
from kolsky.quasistatic.stability import Stability, drucker
from kolsky.quasistatic.testdata import HomogeneousTest, mean_test

__all__ = [
    "Fit",
    "FitOutcome",
    "HomogeneousTest",
    "Mode",
    "Stability",
    "Weighting",
    "compressible_stress",
    "drucker",
    "fit",
    "free_stretch",
    "incompressible_stress",
    "mean_test",
    "mode_named",
]
