"""The interface of an element, and the Warp functions that elements share.

An element gives Warp functions for the forces and the energy of one quadrilateral. It also gives the array of
reference-configuration constants that they read. The sweeps do not depend on its stress points or strains.

Stable step: the volumetric part has a sharp bound (rank one). Stiffness and damping of the other parts are
bounded by moduli times |grad v|^2. Over the corners' masses this form is a sum of squares (b . v)^2 of a few
vectors b. Its largest eigenvalue is that of the Gram matrix of these vectors. It is below the trace, and
below the largest sum of a row's absolute values (Gershgorin).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.arrays import FloatArray
from explicit.mesh import Mesh
from explicit.precision import Precision

INVERTED = 1.0e30
"""Step bound of an element with J <= 0 [1/s^2]. A real omega^2 is much smaller (1e14 at most)."""


@dataclass(frozen=True)
class ElementFunctions:
    """Structs and functions of an element for one material law and precision."""

    Shape: Any
    """Warp struct of real numbers and 4-vectors: reference-configuration constants of one element, including
    `volume` [m^3]. `Element.shapes` fills an array of it."""
    read_shape: Any
    """``read_shape(constants, e, measure) -> Shape``: one element's constants from a grouped table
    (`explicit.layout.structs.grouped`). Only `entry_function` and `entries_function` of that module read this
    table. Constants of the step bound are read only if `measure` is 1."""
    Solid: Any
    """Warp struct: moduli and viscosities of one sample."""
    forces: Any
    """``forces(shape, solid, row, ur, uy, vr, vy, measure) -> (f_r, f_y, omega_squared, power, artificial)``:
    corner forces [N], the bound for the stable step [1/s^2], and the powers dissipated by the solid's damping
    and by hourglass control [W]. They follow from the corners' displacements and velocities. The bound is 0
    unless `measure` is 1, and `INVERTED` if the element is inverted."""
    energies: Any
    """``energies(shape, solid, row, ur, uy) -> (elastic, hourglass, s)``: stored energies [J], and the
    largest s = sqrt(I1_bar - 3) of the element's stress points [-]."""
    strains: Any
    """``strains(shape, ur, uy) -> (J, s)``: the smallest of det F and its planar part over the stress points
    [-], positive unless the element is inverted, and the largest s [-]."""
    stress_point: Any
    """``stress_point(shape, g) -> (weight, gradient_r, gradient_y, hoop)``: volume of the g-th stress point
    [m^3], and the vectors that give the deformation gradient there from the corners' displacements [1/m]."""
    n_points: int
    """Number of stress points."""


class Element(Protocol):
    """Interface of an element."""

    @property
    def name(self) -> str:
        """Its name in `explicit.Model.element`."""
        ...

    def functions(
        self, law: type, precision: Precision, bound: str = "trace", volumetric: str = "quadratic"
    ) -> ElementFunctions:
        """Generate the functions for a material law (a class with `kernel_functions`), a precision, a step
        bound (`explicit.model.Stepping.bound`) and a volumetric form (`explicit.Model.volumetric`)."""
        ...

    def shapes(self, mesh: Mesh, density: float, dtype: np.dtype[Any]) -> NDArray[Any]:
        """Integrate the constants of every element.

        Parameters
        ----------
        mesh : Mesh
            The undeformed mesh.
        density : float
            Mass density [kg/m^3]. The step bound needs the share of each element in the mass of its corners.
        dtype : numpy.dtype
            ``functions(...).Shape.numpy_dtype()``.

        Returns
        -------
        array, shape [n_elements]
            One `Shape` per element.
        """
        ...


def corner_inverse_mass(
    mesh: Mesh, density: float, corner_volume: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Inverse of each corner's own share of the mass, radial and axial [1/kg], shape [n_elements, 4].

    Radial entries are 0 on the axis: a node cannot move outwards there.
    """
    inverse = 1.0 / (density * corner_volume)
    return np.where(mesh.on_axis[mesh.quads], 0.0, inverse), inverse


@cache
def solid_struct(precision: Precision) -> Any:
    """Generate the struct of one sample's moduli [Pa], viscosities [Pa s], drag [1/s] and the root of the
    modulus that scales viscous hourglass control [Pa^(1/2)]."""
    real = precision.real

    @wp.struct
    class Solid:
        scale: real
        bulk: real
        hourglass: real
        shear_viscosity: real
        bulk_viscosity: real
        hourglass_viscosity: real
        hourglass_impedance: real
        mass_damping: real

    return Solid


@cache
def isochoric_factor_function(precision: Precision) -> Any:
    """Generate ``f(J, J - 1) -> (J^(-2/3), 1 / J)`` [-]: the factor that makes b isochoric, and 1 / J without
    a division.

    Near J = 1, the range of a nearly incompressible solid, J^(-1/3) is a series in J - 1. The series of (1 -
    e)^(-1/3) in its error e corrects it.
    """
    real = precision.real
    one, third = real(1.0), real(1.0 / 3.0)
    two_ninths, next_term = real(2.0 / 9.0), real(14.0 / 81.0)
    near_one = real(0.05)  # e is below 7e-5 there, so the neglected terms are below 1e-17

    @wp.func
    def isochoric_factor(jacobian: real, dilatation: real):
        y = one - dilatation * (third - two_ninths * dilatation)
        e = one - (jacobian * y) * (y * y)
        y = y + (y * e) * (third + e * (two_ninths + e * next_term))
        if wp.abs(dilatation) > near_one:
            y = one / wp.cbrt(jacobian)
        return y * y, y * y * y

    return isochoric_factor


@cache
def gradient_bounds_function(precision: Precision, bound: str) -> Any:
    """Generate ``f(w_r, w_y, b_r, b_y, c) -> (radial, axial)``: upper bounds of |grad v|^2 over sum v^2 / w
    of the corners [1/(kg m^2)], for radial and for axial motion, by the "trace" or by the "eigenvalue". The
    two motions do not couple."""
    real, vec4 = precision.real, precision.vec4

    @wp.func
    def traces(w_r: vec4, w_y: vec4, b_r: vec4, b_y: vec4, c: vec4):
        radial, axial = real(0.0), real(0.0)
        for a in range(4):
            gradient = b_r[a] * b_r[a] + b_y[a] * b_y[a]
            radial += w_r[a] * (gradient + c[a] * c[a])
            axial += w_y[a] * gradient
        return radial, axial

    @wp.func
    def rows(w_r: vec4, w_y: vec4, b_r: vec4, b_y: vec4, c: vec4):
        rr, yy, tt, ry, rt, yt = real(0.0), real(0.0), real(0.0), real(0.0), real(0.0), real(0.0)
        axial_rr, axial_yy, axial_ry = real(0.0), real(0.0), real(0.0)
        for a in range(4):
            rr += w_r[a] * b_r[a] * b_r[a]
            yy += w_r[a] * b_y[a] * b_y[a]
            tt += w_r[a] * c[a] * c[a]
            ry += w_r[a] * b_r[a] * b_y[a]
            rt += w_r[a] * b_r[a] * c[a]
            yt += w_r[a] * b_y[a] * c[a]
            axial_rr += w_y[a] * b_r[a] * b_r[a]
            axial_yy += w_y[a] * b_y[a] * b_y[a]
            axial_ry += w_y[a] * b_r[a] * b_y[a]
        ry, rt, yt = wp.abs(ry), wp.abs(rt), wp.abs(yt)
        radial = wp.max(wp.max(rr + ry + rt, yy + ry + yt), tt + rt + yt)
        axial = wp.max(axial_rr, axial_yy) + wp.abs(axial_ry)
        return wp.min(radial, rr + yy + tt), wp.min(axial, axial_rr + axial_yy)

    return {"trace": traces, "eigenvalue": rows}[bound]


@cache
def shear_bound_function(law_tangent: Any, precision: Precision) -> Any:
    """Generate ``f(rr, yy, ry, tt, row)``: an upper bound of the second variation of U(I1_bar) over |grad
    v|^2 [Pa].

    The variation is 2U' [L b L + I1/3 tr L^2 - 4/3 tr L (dev b L) - 2/9 I1 tr^2 L] and a part with U''. The
    law bounds the term with b and the part with U''. The other terms are added here, for the worst tr L.
    """
    real = precision.real
    one, two, third, two_thirds = real(1.0), real(2.0), real(1.0 / 3.0), real(2.0 / 3.0)

    @wp.func
    def shear_bound(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        drr, dyy, dtt = rr - mean, yy - mean, tt - mean
        squared = drr * drr + dyy * dyy + dtt * dtt + two * ry * ry
        largest = wp.max(wp.max(rr, yy) + wp.abs(ry), tt)
        factor = one + (mean + two_thirds * squared / mean) / largest
        return factor * law_tangent(rr, yy, ry, tt, row)

    return shear_bound
