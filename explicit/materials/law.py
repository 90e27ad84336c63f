"""Closed-form laws: what one offers, and how one is added.

To add a law write one file in `explicit.materials.laws` with

1. a frozen dataclass derived from `explicit.materials.invariants.InvariantLaw` (the energy is a function of
   I1_bar and I2_bar) or from `explicit.materials.stretches.StretchLaw` (of the principal stretches), with one
   field for each entry of its ``PARAMETERS``, in that order;
2. its energy and derivatives in NumPy (``W``, ``dW_dI``, ``d2W_dI2``, or the three of a `StretchLaw`), which
   are the twin that tests and fits use;
3. the same as Warp functions of ``(..., row)``, where ``row`` holds what its ``parameters`` returns;
4. one line in `explicit.materials.laws.LAWS`.

The class then has all of `explicit.materials.base.MaterialLaw`: stress, energy, the bound of the tangent for
the stable step, in NumPy and in Warp, for every driver, element and precision.
`tests/unit/explicit/test_material_laws.py` goes over `LAWS` and holds every member to its own energy. A law
gives the isochoric part alone; the volumetric part is `explicit.materials.volumetric`'s, and the solver's
stiffness factor multiplies both.
"""

from dataclasses import dataclass, field, replace
from math import inf
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray


@dataclass(frozen=True)
class ParameterSpec:
    """One constant of a law.

    Inside ``[lower, upper]`` for all constants of a law its energy is positive at any deformation. The
    interval is sufficient and, unless `strict`, not necessary: a fit without bounds may leave it (a Yeoh C20
    is often negative), and `ClosedFormLaw.outside` then says so.
    """

    name: str
    """The field of the law."""
    unit: str
    """ "Pa" or "1"."""
    lower: float
    """Smallest value, in `unit`; it may be taken."""
    upper: float
    """Largest value, in `unit`; it may be taken if it is finite."""
    example: float
    """A value of a soft rubber, in `unit`: a start for a fit, a number for a test."""
    meaning: str
    """What it is, in words."""
    strict: bool = False
    """Whether the law is not defined, or never positive, outside: such a value is refused."""


class Stretches(Protocol):
    """Energy of principal stretches W(lam1, lam2, lam3), for homogeneous tests and fits.

    The arguments are taken as they stand. An incompressible solution gives stretches of product 1; a
    compressible one divides them by J^(1/3) first, see `explicit.materials.principal`.
    """

    def strain_energy(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        """W [Pa], shape [...]."""
        ...

    def principal(
        self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """dW/dlam_i [Pa], each of shape [...]."""
        ...

    def hessian(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        """d2W/dlam_i dlam_j [Pa], shape [..., 3, 3]."""
        ...


@dataclass(frozen=True)
class ClosedFormLaw:
    """Constants, bounds and scaling, the same for every law given by a formula."""

    fitted_s: float = field(default=inf, kw_only=True)
    """Largest s = sqrt(I1_bar - 3) of the data that the constants were fitted to [-]; infinity if nobody
    knows. The law goes on past it, and the solver says how much of the specimen went there."""

    NAME: ClassVar[str]
    """The name in `explicit.materials.laws.LAWS` and in a shot file."""
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]]
    """The constants, in the order of the fields."""
    FORMULA: ClassVar[str] = ""
    """W as LaTeX, for the table of the laws; without it the table has the first line of the docstring."""
    MODULUS: ClassVar[str] = ""
    """The shear modulus at rest as LaTeX, for the same table."""

    def __post_init__(self) -> None:
        if not self.fitted_s > 0.0:
            raise ValueError(f"{self.NAME}: fitted_s must be > 0, got {self.fitted_s}")
        for spec, value in zip(self.PARAMETERS, self.constants(), strict=True):
            if not np.isfinite(value):
                raise ValueError(f"{self.NAME}: {spec.name} must be finite, got {value}")
            if spec.strict and not spec.lower <= value <= spec.upper:
                raise ValueError(
                    f"{self.NAME}: {spec.name} must be in [{spec.lower:g}, {spec.upper:g}]{_unit(spec)}, got "
                    f"{value:g}: {spec.meaning}"
                )
        if not self.shear_modulus > 0.0:
            raise ValueError(
                f"{self.NAME}: the initial shear modulus must be > 0 Pa, got {self.shear_modulus:g} from "
                + ", ".join(f"{spec.name} = {getattr(self, spec.name):g}" for spec in self.PARAMETERS)
            )

    @property
    def shear_modulus(self) -> float:
        """mu_0, the shear modulus at rest [Pa]."""
        raise NotImplementedError

    @property
    def initial_shear_modulus(self) -> float:
        """mu_0 [Pa], by the name of `explicit.materials.base.MaterialLaw`."""
        return self.shear_modulus

    @property
    def data_limit(self) -> float:
        """Largest s the law has data for or is defined for [-]."""
        return self.fitted_s

    def constants(self) -> FloatArray:
        """The constants in the order of `PARAMETERS`, shape [n_parameters]."""
        return np.array([getattr(self, spec.name) for spec in self.PARAMETERS], dtype=np.float64)

    def parameters(self) -> FloatArray:
        """The kernels' row: the constants, unless a law prepares others from them."""
        return self.constants()

    @classmethod
    def of(cls, values: ArrayLike) -> Self:
        """The law with constants in the order of `PARAMETERS`.

        Raises
        ------
        ValueError
            If their number is another, one is not finite or outside a strict interval, or mu_0 is not > 0.
        """
        row = np.asarray(values, dtype=np.float64).ravel()
        if len(row) != len(cls.PARAMETERS):
            names = ", ".join(spec.name for spec in cls.PARAMETERS)
            raise ValueError(f"{cls.NAME} has {len(cls.PARAMETERS)} constants ({names}), got {len(row)}")
        return cls(**{spec.name: float(x) for spec, x in zip(cls.PARAMETERS, row, strict=True)})

    @classmethod
    def example(cls) -> Self:
        """The law of a soft rubber."""
        return cls.of([spec.example for spec in cls.PARAMETERS])

    def scaled(self, factor: float) -> Self:
        """The law with every stress multiplied by a factor: moduli scale, pure numbers stay."""
        scales = [factor if spec.unit == "Pa" else 1.0 for spec in self.PARAMETERS]
        return replace(self.of(self.constants() * scales), fitted_s=self.fitted_s)

    def outside(self) -> tuple[str, ...]:
        """Constants outside the intervals that keep the energy positive, in words."""
        return tuple(
            f"{spec.name} = {value:g}{_unit(spec)} is outside [{spec.lower:g}, {spec.upper:g}]"
            for spec, value in zip(self.PARAMETERS, self.constants(), strict=True)
            if not spec.lower <= value <= spec.upper
        )


def _unit(spec: ParameterSpec) -> str:
    return "" if spec.unit == "1" else f" {spec.unit}"
