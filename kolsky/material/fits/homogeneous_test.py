"""A homogeneous test for a fit: one mode, one curve, tension-positive."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.material.fits.modes import Mode, check_deformation


@dataclass(frozen=True)
class HomogeneousTest:
    """Nominal stress over stretch, or over the amount of shear."""

    name: str
    """Name of the test, for messages and tables."""
    mode: Mode
    """Loaded, held and free directions."""
    deformation: FloatArray
    """Stretch along the load, or amount of shear [-], shape [n]."""
    stress: FloatArray
    """Nominal stress, tension-positive [Pa], shape [n]."""
    sigma: FloatArray | None = None
    """Standard uncertainty of each stress [Pa], shape [n]; None if unknown."""
    weight: float = 1.0
    """Factor of the squared residuals of this test in a fit [-]."""
    lateral: FloatArray | None = None
    """Measured stretch of the free direction [-], shape [n]; None if it was not measured."""

    def __post_init__(self) -> None:
        d, T = self.deformation, self.stress
        if d.ndim != 1 or d.shape != T.shape:
            raise ValueError(
                f"{self.name}: deformation {d.shape} and stress {T.shape} must have one shape [n]"
            )
        if len(d) < 3:
            raise ValueError(f"{self.name}: a curve needs at least 3 points, got {len(d)}")
        try:
            check_deformation(self.mode, d)
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None
        if not np.isfinite(T).all():
            raise ValueError(f"{self.name}: stress {int(np.argmin(np.isfinite(T)))} is not finite")
        if not float(self.mode.strain(d) @ T) > 0.0:
            raise ValueError(
                f"{self.name}: stress and strain differ in sign over the whole curve; stress and strain of "
                "compression are both negative here: correct the sign convention"
            )
        if self.sigma is not None and not (self.sigma.shape == T.shape and (self.sigma > 0.0).all()):
            raise ValueError(f"{self.name}: sigma must be > 0 Pa at every point, shape {T.shape}")
        if self.lateral is not None:
            if self.mode is Mode.SIMPLE_SHEAR:
                raise ValueError(f"{self.name}: simple shear has no free direction")
            if not (self.lateral.shape == d.shape and (self.lateral > 0.0).all()):
                raise ValueError(f"{self.name}: lateral stretches must be > 0, shape {d.shape}")
        if not 0.0 < self.weight < float("inf"):
            raise ValueError(f"{self.name}: weight must be > 0 and finite, got {self.weight}")

    @property
    def strain(self) -> FloatArray:
        """Nominal strain, or amount of shear [-], shape [n]."""
        return self.mode.strain(self.deformation)

    def within(self, low: float, high: float) -> Self:
        """The part between two nominal strains (or amounts of shear).

        Raises
        ------
        ValueError
            If it has fewer than 3 points.
        """
        kept = (self.strain >= low) & (self.strain <= high)
        return replace(
            self,
            deformation=self.deformation[kept],
            stress=self.stress[kept],
            sigma=None if self.sigma is None else self.sigma[kept],
            lateral=None if self.lateral is None else self.lateral[kept],
        )


def mean_test(tests: Sequence[HomogeneousTest], *, points: int = 200, name: str = "mean") -> HomogeneousTest:
    """The mean of repeats of one test at equally spaced strains from rest to the end they all reach.

    Parameters
    ----------
    tests
        Repeats: one mode, one direction of load, the strain increasing in size.
    points
        Strains of the mean.
    name
        Its name.

    Returns
    -------
    HomogeneousTest
        Its `sigma` is that of the mean by the scatter between the tests; None of a single test, and where
        the tests agree to the last digit at a point.

    Raises
    ------
    ValueError
        If the modes differ, a test has both tension and compression, or its strain goes back.
    """
    if not tests:
        raise ValueError("no tests to average")
    modes = {test.mode for test in tests}
    if len(modes) > 1:
        raise ValueError(f"only one mode can be averaged, got {', '.join(sorted(m.value for m in modes))}")
    curves = [_outward(test) for test in tests]
    signs = {sign for _, _, sign in curves}
    if len(signs) > 1:
        raise ValueError(f"{tests[0].name} and others are loaded in opposite directions: average each alone")
    axis = np.linspace(max(e[0] for e, _, _ in curves), min(e[-1] for e, _, _ in curves), points)
    values = np.array([np.interp(axis, strain, stress) for strain, stress, _ in curves])
    sigma = values.std(axis=0, ddof=1) / np.sqrt(len(tests)) if len(tests) > 1 else None
    return HomogeneousTest(
        name=name,
        mode=tests[0].mode,
        deformation=tests[0].mode.at_rest + signs.pop() * axis,
        stress=values.mean(axis=0),
        sigma=sigma if sigma is not None and (sigma > 0.0).all() else None,
    )


def _outward(test: HomogeneousTest) -> tuple[FloatArray, FloatArray, float]:
    """Size of the strain from rest outward, stress, sign of the strain."""
    strain = test.strain
    sign = 1.0 if strain[np.argmax(np.abs(strain))] > 0.0 else -1.0
    size = sign * strain
    if (size < -1e-3 * size.max()).any():
        raise ValueError(f"{test.name} holds tension and compression: repeats are averaged branch by branch")
    if (np.diff(size) <= 0.0).all():  # a table that is sorted by stretch lists compression from its end
        return size[::-1], test.stress[::-1], sign
    back = np.flatnonzero(np.diff(size) < 0.0)
    if back.size:
        raise ValueError(
            f"{test.name}: the strain goes back at point {back[0] + 1} ({strain[back[0]]:.6g} to "
            f"{strain[back[0] + 1]:.6g}): give one loading ramp"
        )
    return size, test.stress, sign
