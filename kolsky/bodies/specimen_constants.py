"""Constants of a compressible law with Poisson's ratio instead of the bulk modulus.

The law can also be written as a curve.

`identify` reads this curve as [curve] or [law] of a shot.

A fit of the energy's constants can reach values at which all elements are unstable. Schumacher and others
(2020, Table I) therefore take the bulk modulus from linear elasticity,

    K = 2 mu_0 (1 + nu) / (3 (1 - 2 nu)),   mu_0 the law's shear modulus at rest,               (S.I)

They fix nu (or bound it, 0 < nu < 1/2 - eps), and keep every constant that multiplies an energy non-negative.
Their D1 is K/2. There are three kinds of law:

- every law of `explicit.materials.LAWS` with K/2 (J - 1)^2,
- "yeoh_d": Yeoh's with D1 (J - 1)^2 + D2 (J - 1)^4 + D3 (J - 1)^6,
- "neo_hookean_coupled": mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2, fitted in E and nu. In a plane model it
  is the law of Sutula and others (2020, Eq. 37).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from explicit.materials import LAWS, AnyLaw
from explicit.materials.law import ParameterSpec
from explicit.materials.volumetric import bulk_modulus
from explicit.relaxation import uniaxial_stress
from kolsky.base.arrays import FloatArray
from kolsky.equilibrium.solid import CompressibleNeoHookean, Isotropic, Solid, bulk, polynomial
from kolsky.material.uniaxial import CurveBand

POISSON = "poisson"
"""Name of Poisson's ratio among the constants."""
LARGEST_POISSON = 0.4999
"""Upper bound of a free Poisson's ratio: 1/2 - eps."""
YOUNG = "E"
"""Name of Young's modulus, the other constant of the coupled law."""
_SECOND_DIFFERENCE = 1e-3
"""Relative step of the second derivatives of this map."""
COUPLED, YEOH_D = "neo_hookean_coupled", "yeoh_d"
DIFFERENCE = 1e-6
"""Relative step of the derivatives of the map from fitted constants to those of the energy."""


def constants_of(law: str) -> tuple[ParameterSpec, ...]:
    """Constants of a law by name, Poisson's ratio last.

    Raises ValueError if there is no such law. The message lists the available laws.
    """
    poisson = ParameterSpec(POISSON, "1", 0.0, LARGEST_POISSON, 0.45, "Poisson's ratio at rest")
    if law == COUPLED:
        return ParameterSpec(YOUNG, "Pa", 0.0, np.inf, 1e5, "Young's modulus at rest"), poisson
    known = LAWS.get("yeoh" if law == YEOH_D else law)
    if known is None:
        raise ValueError(f"law must be one of {', '.join(sorted([*LAWS, COUPLED, YEOH_D]))}, got {law!r}")
    more = ("D2", "D3") if law == YEOH_D else ()
    return (
        *known.PARAMETERS,
        *(ParameterSpec(name, "Pa", 0.0, np.inf, 0.0, "volumetric modulus") for name in more),
        poisson,
    )


def solid_of(law: str, values: Mapping[str, float]) -> Solid:
    """The material with these constants, Eq. (S.I).

    Raises ValueError if the constants are invalid: the shear modulus at rest is not > 0, or Poisson's ratio
    is outside [0, 0.5).
    """
    nu = values[POISSON]
    if law == COUPLED:
        return CompressibleNeoHookean.from_young(values[YOUNG], nu)
    kind = LAWS["yeoh" if law == YEOH_D else law]
    made = kind.of([values[spec.name] for spec in kind.PARAMETERS])
    modulus = float(bulk_modulus(made.shear_modulus, nu))
    volumetric = polynomial(0.5 * modulus, values["D2"], values["D3"]) if law == YEOH_D else bulk(modulus)
    return Isotropic(made, volumetric)


@dataclass(frozen=True)
class Constants:
    """The constants of a law, their values, and the names of the free ones."""

    law: str
    """A name accepted by `constants_of`."""
    values: Mapping[str, float]
    """Every constant, SI."""
    free: tuple[str, ...]
    """Names of the fitted constants."""
    regions: tuple[str, ...] = ()
    """Further regions of the same law; their constants are named "skin.E" and so on."""

    def __post_init__(self) -> None:
        names = [spec.name for spec in self.specs]
        for name in names:
            if name not in self.values:
                raise ValueError(f"{self.law} needs {name}; its constants are {', '.join(names)}")
        for name in (*self.values, *self.free):
            if name not in names:
                raise ValueError(f"{self.law} has no constant {name}; it has {', '.join(names)}")
        if len(set(self.free)) != len(self.free):
            raise ValueError("a free constant is named twice")
        for spec in self.specs:
            if not spec.lower <= self.values[spec.name] <= spec.upper and spec.name in self.free:
                raise ValueError(
                    f"{spec.name} must start in [{spec.lower:g}, {spec.upper:g}], got "
                    f"{self.values[spec.name]:g}"
                )

    @property
    def specs(self) -> tuple[ParameterSpec, ...]:
        """All constants."""
        own = constants_of(self.law)
        further = (replace(spec, name=f"{name}.{spec.name}") for name in self.regions for spec in own)
        return (*own, *further)

    @property
    def free_specs(self) -> tuple[ParameterSpec, ...]:
        """The free constants, in their order."""
        known = {spec.name: spec for spec in self.specs}
        return tuple(known[name] for name in self.free)

    @property
    def start(self) -> FloatArray:
        """Values of the free constants, shape [n_free]."""
        return np.array([self.values[name] for name in self.free])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the free constants, each of shape [n_free], Table I."""
        return (
            np.array([spec.lower for spec in self.free_specs]),
            np.array([spec.upper for spec in self.free_specs]),
        )

    @property
    def scales(self) -> FloatArray:
        """Scales of the free constants: mu_0 at the start for moduli, 1 for pure numbers."""
        shear = self.solid(self.start).shear_modulus
        return np.array([shear if spec.unit == "Pa" else 1.0 for spec in self.free_specs])

    def all(self, free: Sequence[float] | FloatArray) -> dict[str, float]:
        """All constants, with the given values of the free ones."""
        return {**self.values, **dict(zip(self.free, map(float, free), strict=True))}

    def with_free(self, free: Sequence[float] | FloatArray) -> "Constants":
        """These constants, with the given values of the free ones."""
        return replace(self, values=self.all(free))

    def solid(self, free: Sequence[float] | FloatArray) -> Solid:
        """The material with these values of the free constants."""
        return self.solids(free)[0]

    def solids(self, free: Sequence[float] | FloatArray) -> tuple[Solid, ...]:
        """The materials of the first region and of the further ones."""
        values, names = self.all(free), [spec.name for spec in constants_of(self.law)]
        heads = ("", *(f"{region}." for region in self.regions))
        return tuple(solid_of(self.law, {name: values[head + name] for name in names}) for head in heads)

    def chain(self, free: Sequence[float] | FloatArray) -> FloatArray:
        """Derivative of the materials' parameters (region by region) by the free constants.

        Shape [n_parameters, n_free]. The derivative of a force by the fitted constants is its derivative by
        the energy's constants times this matrix. It uses central differences of the closed form. A difference
        is one-sided if the point on the other side is invalid.
        """
        return self.differences(
            free, DIFFERENCE, lambda at: np.concatenate([solid.parameters() for solid in self.solids(at)])
        )

    def differences(
        self, free: Sequence[float] | FloatArray, share: float, value: Callable[[FloatArray], FloatArray]
    ) -> FloatArray:
        """Central differences of a value of shape [n] by the free constants, shape [n, n_free]. The steps are
        the given shares of their sizes. A difference is one-sided if the point on the other side is invalid.
        """
        at = np.asarray(free, dtype=np.float64)
        changes = []
        for j, size in enumerate(self.scales):
            step = share * max(abs(at[j]), 1e-2 * size)
            ends = []
            for sign in (1.0, -1.0):
                moved = at.copy()
                moved[j] += sign * step
                try:
                    self.solids(moved)
                except ValueError:
                    moved = at
                ends.append((moved[j], value(moved)))
            (up, above), (down, below) = ends
            changes.append((above - below) / (up - down))
        return np.stack(changes, axis=-1)

    def chain_changes(self, free: Sequence[float] | FloatArray) -> FloatArray:
        """Derivative of `chain` by the free constants, shape [n_parameters, n_free, n_free]. Differences of
        `chain`. A difference is one-sided if the point on the other side is invalid."""
        whole = self.differences(free, _SECOND_DIFFERENCE, self.chain)
        return np.asarray(0.5 * (whole + np.swapaxes(whole, 1, 2)))


POINTS = 41
"""Number of points of the curve, with the point at rest."""


def _incompressible_law(constants: Constants, free: FloatArray) -> AnyLaw:
    """The law of `explicit.materials` with these constants. The coupled law becomes neo-Hookean."""
    values = constants.all(free)
    if constants.law == COUPLED:
        return LAWS["neo_hookean"].of([values[YOUNG] / (2.0 * (1.0 + values[POISSON]))])
    kind = LAWS["yeoh" if constants.law == YEOH_D else constants.law]
    return kind.of([values[spec.name] for spec in kind.PARAMETERS])


def law_curve(
    constants: Constants,
    covariance: FloatArray,
    *,
    branch: Literal["tension", "compression"],
    largest_strain: float,
) -> CurveBand:
    """The curve of a fitted law, positive along its branch, with the uncertainty of its constants.

    ``covariance``: of the free constants, SI, shape [p, p]. It is not finite if unknown; the curve then has
    no modes. ``largest_strain``: nominal, > 0 and in compression < 1.
    """
    side = 1.0 if branch == "tension" else -1.0
    stretch = np.linspace(1.0, 1.0 + side * largest_strain, POINTS)
    free = constants.start
    stress = side * uniaxial_stress(_incompressible_law(constants, free), stretch)
    band = CurveBand(side * (stretch - 1.0), stress, np.zeros(POINTS), np.zeros((0, POINTS)), ())
    if not np.isfinite(covariance).all():
        return band
    values, vectors = np.linalg.eigh(covariance)
    slopes = constants.differences(
        free, DIFFERENCE, lambda at: side * uniaxial_stress(_incompressible_law(constants, at), stretch)
    )
    modes = (vectors * np.sqrt(np.maximum(values, 0.0))).T @ slopes.T
    kept = modes[np.abs(modes).max(axis=1) > 0.0]
    return replace(band, modes=kept, names=("constants",) * len(kept))
