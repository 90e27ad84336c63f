"""Residuals of a law against homogeneous tests, as a function of its free constants."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from explicit.materials import AnyLaw, bulk_modulus
from explicit.materials.law import ParameterSpec
from explicit.materials.volumetric import VolumetricLaw
from kolsky.base.arrays import FloatArray
from kolsky.material.fits.homogeneous import compressible_stress, free_stretch, incompressible_stress
from kolsky.material.fits.homogeneous_test import HomogeneousTest

FREE_POISSON = ParameterSpec(
    "poisson", "1", 0.0, 0.4999, 0.45, "Poisson's ratio at rest, of the bulk modulus", strict=True
)
"""The unknown beside a law's constants where the compressibility is free."""
LATERAL_SCALE = 0.01
"""Lateral stretch that weighs like the largest stress in a fit [-]: the size of a good strain measurement."""
REFUSED = 1e8
"""Residual, in units of the largest stress, of constants that make no law or no stress."""


class Weighting(Enum):
    """Divisor of the residuals."""

    ABSOLUTE = "absolute"
    """By one stress for all points: the sum of squares in Pa^2 is least."""
    RELATIVE = "relative"
    """By the measured stress of the point: small strains count as much as large ones."""
    SIGMA = "sigma"
    """By the standard uncertainty of the point."""


@dataclass(frozen=True)
class Residuals:
    """Weighted residuals of a law as a function of its free constants.

    Its unknowns are the free constants with moduli in units of the largest measured stress, so that all are
    of one size.
    """

    law: type[AnyLaw]
    """The law."""
    tests: tuple[HomogeneousTest, ...]
    """The tests to be met at once."""
    weighting: Weighting
    """Divisor of the residuals."""
    held: Mapping[str, float]
    """Constants that are not free, in SI."""
    poisson: float | None
    """Poisson's ratio at rest of the compressible solution; None for the incompressible one."""
    free_poisson: bool = False
    """True if that ratio is the last unknown; the tests' lateral stretches are then met too."""

    @cached_property
    def free(self) -> tuple[ParameterSpec, ...]:
        """The free constants, in the order of the law, and Poisson's ratio if it is free."""
        constants = tuple(spec for spec in self.law.PARAMETERS if spec.name not in self.held)
        return (*constants, FREE_POISSON) if self.free_poisson else constants

    @cached_property
    def stress_scale(self) -> float:
        """Largest measured stress [Pa]."""
        return max(float(np.abs(test.stress).max()) for test in self.tests)

    @cached_property
    def units(self) -> FloatArray:
        """SI per unit of the unknowns, shape [n_free]."""
        return np.array([self.stress_scale if spec.unit == "Pa" else 1.0 for spec in self.free])

    @cached_property
    def counted(self) -> tuple[FloatArray, ...]:
        """Factor of every residual [1/Pa], shape [n] for each test; 0 for a point at rest under relative
        weighting, where law and measurement are both zero and say nothing."""
        factors = []
        for test in self.tests:
            if self.weighting is Weighting.SIGMA:
                assert test.sigma is not None
                divisor = test.sigma
            elif self.weighting is Weighting.RELATIVE:
                divisor = np.where(test.strain == 0.0, np.inf, np.abs(test.stress))
            else:
                divisor = np.full(len(test.stress), self.stress_scale)
            factors.append(np.sqrt(test.weight) / divisor)
        return tuple(factors)

    @cached_property
    def n(self) -> int:
        """Residuals that count."""
        lateral = sum(t.lateral.size for t in self.tests if t.lateral is not None) if self.free_poisson else 0
        return lateral + sum(int(np.count_nonzero(factor)) for factor in self.counted)

    def build(self, unknowns: FloatArray) -> AnyLaw:
        """The law of the unknowns.

        Raises
        ------
        ValueError
            If they make no law.
        """
        values = dict(self.held)
        values.update({spec.name: float(x) for spec, x in zip(self.free, unknowns * self.units, strict=True)})
        values.pop(FREE_POISSON.name, None)
        return self.law.of([values[spec.name] for spec in self.law.PARAMETERS])

    def ratio(self, unknowns: FloatArray) -> float | None:
        """Poisson's ratio of the unknowns, or the held one."""
        return float(unknowns[-1]) if self.free_poisson else self.poisson

    def stress(self, law: AnyLaw, poisson: float | None) -> tuple[FloatArray, ...]:
        """Nominal stress of a law at the points of each test [Pa]; incompressible without a ratio.

        Raises
        ------
        ValueError
            If the compressible solution does not exist somewhere.
        """
        if poisson is None:
            return tuple(incompressible_stress(law, test.mode, test.deformation) for test in self.tests)
        volume = VolumetricLaw(float(bulk_modulus(law.shear_modulus, poisson)))
        return tuple(compressible_stress(law, volume, test.mode, test.deformation) for test in self.tests)

    def lateral(self, law: AnyLaw, poisson: float | None) -> list[FloatArray]:
        """Simulated less measured lateral stretch over `LATERAL_SCALE` where it is fitted [-]."""
        if not self.free_poisson or poisson is None:
            return []
        volume = VolumetricLaw(float(bulk_modulus(law.shear_modulus, poisson)))
        return [
            np.sqrt(test.weight)
            * (free_stretch(law, volume, test.mode, test.deformation) - test.lateral)
            / LATERAL_SCALE
            for test in self.tests
            if test.lateral is not None
        ]

    @cached_property
    def _rows(self) -> int:
        lateral = [t.lateral for t in self.tests if t.lateral is not None] if self.free_poisson else []
        return sum(len(test.stress) for test in self.tests) + sum(len(row) for row in lateral)

    def __call__(self, unknowns: FloatArray) -> FloatArray:
        """Weighted residuals of all tests, one after the other [-], shape [n_points]."""
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                law, ratio = self.build(unknowns), self.ratio(unknowns)
                predicted, across = self.stress(law, ratio), self.lateral(law, ratio)
            except ValueError:
                return np.full(self._rows, REFUSED)
            rows = [
                (T - test.stress) * factor
                for T, test, factor in zip(predicted, self.tests, self.counted, strict=True)
            ]
            whole = np.concatenate([*rows, *across])
            return np.where(np.abs(whole) < REFUSED, whole, REFUSED)


def residuals_of(
    law: type[AnyLaw],
    tests: Sequence[HomogeneousTest],
    *,
    weighting: Weighting = Weighting.ABSOLUTE,
    held: Mapping[str, float] | None = None,
    poisson: float | None = None,
    free_poisson: bool = False,
) -> Residuals:
    """The residuals of a law, with what is asked of it checked.

    Raises
    ------
    ValueError
        If there are no tests, a held constant is not the law's, none is free, there are not more points than
        free constants, the tests lack the sigma that weights them, or a stress of zero would be divided by.
    """
    if not tests:
        raise ValueError("a fit needs at least one test")
    names = [spec.name for spec in law.PARAMETERS]
    for name in held or {}:
        if name not in names:
            raise ValueError(f"{law.NAME} has no constant {name!r}; it has {', '.join(names)}")
    made = Residuals(law, tuple(tests), weighting, dict(held or {}), poisson, free_poisson)
    if free_poisson and all(test.lateral is None for test in tests):
        raise ValueError("Poisson's ratio is free only where a test has lateral stretches")
    if not made.free:
        raise ValueError(f"{law.NAME}: all constants are held, nothing is left to fit")
    for test in tests:
        if weighting is Weighting.SIGMA and test.sigma is None:
            raise ValueError(f"{test.name} has no sigma to be weighted by: weight absolute or relative")
        zero = (test.stress == 0.0) & (test.strain != 0.0)
        if weighting is Weighting.RELATIVE and zero.any():
            raise ValueError(
                f"{test.name}: the stress is 0 at strain {test.strain[zero][0]:.6g}, so no relative residual "
                "exists: leave the point out, or weight absolute"
            )
    if made.n <= len(made.free):
        raise ValueError(f"{law.NAME} has {len(made.free)} free constants, the tests only {made.n} points")
    return made
