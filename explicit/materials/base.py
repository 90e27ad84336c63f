"""The door for a material law.

A law gives the *isochoric* Kirchhoff stress of an isotropic hyperelastic solid; the driver scales it
by the stiffness factor and adds the volumetric part and the damping, so a law knows neither.
"""

from typing import Any, Protocol

from explicit.arrays import FloatArray
from explicit.precision import Precision


class MaterialLaw(Protocol):
    """Interface of a material law.

    An instance holds the constants of one material; a batch may mix instances of one class.
    """

    @property
    def initial_shear_modulus(self) -> float:
        """Shear modulus at rest mu_0 [Pa]."""
        ...

    @property
    def data_limit(self) -> float:
        """Largest s = sqrt(I1_bar - 3) the law has data for [-]; infinity for a closed-form law."""
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
