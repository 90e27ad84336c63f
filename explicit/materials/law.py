"""Material laws: the interface to the solver, closed-form laws, and how one is added.

A law gives the isochoric part only: the Kirchhoff stress of an isotropic hyperelastic solid. The volumetric
part is in `explicit.materials.volumetric`, and the solver's stiffness factor multiplies both.

To add a law write one file in `explicit.materials.laws` with

1. a frozen dataclass derived from `explicit.materials.families.InvariantLaw` (the energy is a function of
   I1_bar and I2_bar) or from `explicit.materials.families.StretchLaw` (of the principal stretches), with
   one field for each entry of its ``PARAMETERS``, in that order;
2. its energy and derivatives in NumPy (``W``, ``dW_dI``, ``d2W_dI2``, or the three of a `StretchLaw`). Tests
and fits use this twin. The kernels include I2_bar if this energy depends on it; 3. the same as Warp functions
of ``(..., row)``; ``row`` contains the result of its ``parameters``; 4. one line in
`explicit.materials.laws.LAWS`.

`tests/unit/explicit/test_material_laws.py` compares the stress and tangent of every law in `LAWS` with its
energy.

In the principal axes, with lam_bar_i = J^(-1/3) lam_i and w_i = lam_bar_i dW/dlam_bar_i,

    tau_i = w_i - (w_1 + w_2 + w_3) / 3,                                                       (L.1)
    dtau_i / dln lam_j = P_ik H_kl P_lj,   H_kl = lam_k lam_l W_kl + w_k delta_kl,   P = 1 - 1 1^T / 3,  (L.2)

from which the tangent in simple shear, Drucker's criterion and the stable step follow (Ogden 1984; Simo and
Taylor 1991).
"""

from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.precision import Precision


class MaterialLaw(Protocol):
    """Interface of a material law.

    An instance contains the constants of one material. A batch may contain different instances of one class.
    """

    @property
    def initial_shear_modulus(self) -> float:
        """Shear modulus at rest mu_0 [Pa]."""
        ...

    @property
    def data_limit(self) -> float:
        """Largest s = sqrt(I1_bar - 3) of the law's data [-]; infinity for a closed-form law."""
        ...

    def parameters(self) -> FloatArray:
        """The constants as one flat row for the kernels."""
        ...

    def stress(self, b_bar: FloatArray) -> FloatArray:
        """NumPy twin: isochoric Kirchhoff stress (rr, yy, ry, tt) [Pa] of b_bar (rr, yy, ry, tt)."""
        ...

    def energy(self, b_bar: FloatArray) -> FloatArray:
        """NumPy twin: isochoric strain energy per reference volume [Pa]."""
        ...

    @staticmethod
    def kernel_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """The Warp functions ``(stress, tangent, energy)`` of this class.

        Each takes ``(b_bar_rr, b_bar_yy, b_bar_ry, b_bar_tt, row)``. ``stress`` returns the isochoric
        Kirchhoff stress (rr, yy, ry, tt) as a vec4, ``tangent`` an upper bound of the tangent shear
        modulus (for the stable step), ``energy`` the strain energy per reference volume.
        """
        ...


@dataclass(frozen=True)
class ParameterSpec:
    """One constant of a law.

    If all constants of a law are inside ``[lower, upper]``, its energy is positive at any deformation. The
    interval is sufficient and, unless `strict`, not necessary. A fit without bounds may leave it (a Yeoh C20
    is often negative). `ClosedFormLaw.outside` then reports it.
    """

    name: str
    """The field of the law."""
    unit: str
    """ "Pa" or "1"."""
    lower: float
    """Smallest allowed value, in `unit`."""
    upper: float
    """Largest value, in `unit`. It is allowed if it is finite."""
    example: float
    """A value of a soft rubber, in `unit`: start value of fits and value for tests."""
    meaning: str
    """Its meaning, as text."""
    strict: bool = False
    """Whether the law is not defined or never positive outside the interval. Then such a value is
    rejected."""


class Stretches(Protocol):
    """Energy of principal stretches W(lam1, lam2, lam3), for homogeneous tests and fits.

    The arguments are used unchanged. An incompressible solution has stretches of product 1. A compressible
    solution divides them by J^(1/3) first, see `explicit.materials.law`.
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
    """Largest s = sqrt(I1_bar - 3) of the fitted data [-]; infinity if it is not known. The law continues
    beyond it. The solver reports the share of the specimen with larger strains."""

    NAME: ClassVar[str]
    """The name in `explicit.materials.laws.LAWS` and in a shot file."""
    PARAMETERS: ClassVar[tuple[ParameterSpec, ...]]
    """The constants, in the order of the fields."""
    FORMULA: ClassVar[str] = ""
    """W as LaTeX, for the table of the laws. Without it the table contains the first line of the
    docstring."""
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
        """mu_0 [Pa], by the name of `explicit.materials.law.MaterialLaw`."""
        return self.shear_modulus

    @property
    def data_limit(self) -> float:
        """Largest s for which the law has data or is defined [-]."""
        return self.fitted_s

    def constants(self) -> FloatArray:
        """The constants in the order of `PARAMETERS`, shape [n_parameters]."""
        return np.array([getattr(self, spec.name) for spec in self.PARAMETERS], dtype=np.float64)

    def parameters(self) -> FloatArray:
        """The kernels' row: the constants, or numbers that a law computes from them."""
        return self.constants()

    @classmethod
    def of(cls, values: ArrayLike) -> Self:
        """The law with constants in the order of `PARAMETERS`.

        Raises ValueError if the number of constants is wrong, if one is not finite or outside a strict
        interval, or if mu_0 is not > 0.
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
        """The law with every stress multiplied by a factor. Moduli are scaled, pure numbers are unchanged."""
        scales = [factor if spec.unit == "Pa" else 1.0 for spec in self.PARAMETERS]
        return replace(self.of(self.constants() * scales), fitted_s=self.fitted_s)

    def outside(self) -> tuple[str, ...]:
        """Text: the constants outside the intervals of positive energy."""
        return tuple(
            f"{spec.name} = {value:g}{_unit(spec)} is outside [{spec.lower:g}, {spec.upper:g}]"
            for spec, value in zip(self.PARAMETERS, self.constants(), strict=True)
            if not spec.lower <= value <= spec.upper
        )


def _unit(spec: ParameterSpec) -> str:
    return "" if spec.unit == "1" else f" {spec.unit}"


def isochoric(stretch: ArrayLike) -> FloatArray:
    """Stretches divided by J^(1/3), shape [..., 3]."""
    lam = np.asarray(stretch, dtype=float)
    return np.asarray(lam / np.cbrt(lam.prod(axis=-1))[..., None])


def kirchhoff(law: Stretches, stretch: ArrayLike) -> FloatArray:
    """Isochoric Kirchhoff stress, Eq. (L.1).

    ``law``: a closed-form law. ``stretch``: principal stretches [-], of any volume, shape [..., 3]. Returns:
    principal stresses tau_i [Pa], of sum 0, shape [..., 3].
    """
    w = _logarithmic_slope(law, isochoric(stretch))
    return np.asarray(w - w.mean(axis=-1, keepdims=True))


def tangent(law: Stretches, stretch: ArrayLike) -> FloatArray:
    """Derivative of the isochoric Kirchhoff stress by the logarithms of the stretches, Eq. (L.2) [Pa],
    shape [..., 3, 3]; the stretches have shape [..., 3]."""
    P = np.eye(3) - 1.0 / 3.0
    return np.asarray(P @ logarithmic_hessian(law, isochoric(stretch)) @ P)


def logarithmic_hessian(law: Stretches, lam: FloatArray) -> FloatArray:
    """Second derivatives of W by the logarithms of the stretches [Pa], shape [..., 3, 3]."""
    H = law.hessian(lam[..., 0], lam[..., 1], lam[..., 2]) * lam[..., :, None] * lam[..., None, :]
    return np.asarray(H + np.eye(3) * _logarithmic_slope(law, lam)[..., None])


def _logarithmic_slope(law: Stretches, lam: FloatArray) -> FloatArray:
    return np.stack(law.principal(lam[..., 0], lam[..., 1], lam[..., 2]), axis=-1) * lam


STRETCHES = (0.2, 5.0)
"""Stretches along the load that are checked [-]: to 80 % compression and fivefold length."""
MODES = {
    "uniaxial deformation": (1.0, -0.5, -0.5),
    "equibiaxial deformation": (1.0, 1.0, -2.0),
    "planar deformation": (1.0, 0.0, -1.0),
}
"""Exponents of the load's stretch in each of the three stretches, whose product is 1."""


def not_positive(law: Stretches) -> tuple[str, float] | None:
    """Mode of deformation and stretch nearest to 1 at which the energy of a closed-form law is not above 0.

    None if the energy is positive. Beyond locking a law has no energy and is not checked.
    """
    x = np.geomspace(*STRETCHES, 1201)
    x = x[np.abs(x - 1.0) > 1e-3]
    x = x[np.argsort(np.abs(np.log(x)))]
    for mode, exponents in MODES.items():
        energy = law.strain_energy(*(x**k for k in exponents))
        bad = np.flatnonzero(energy <= 0.0)  # beyond locking it is NaN and is not compared
        if bad.size:
            return mode, float(x[bad[0]])
    return None
