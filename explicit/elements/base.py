"""The door for an element: what the time loop and the sweeps ask of it.

An element gives Warp functions for the forces and the energy of one quadrilateral, and the array of
reference-configuration constants that they read. The sweeps know neither its points nor its strains.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray
from explicit.mesh import Mesh
from explicit.precision import Precision

INVERTED = 1.0e30
"""Step bound that an element with J <= 0 reports; no real omega^2 comes near (1e14 at most)."""


@dataclass(frozen=True)
class ElementFunctions:
    """Structs and functions of an element for one material law and precision."""

    Shape: Any
    """Warp struct of real numbers and 4-vectors: reference-configuration constants of one element, `volume`
    [m^3] among them. `Element.shapes` fills an array of it."""
    read_shape: Any
    """``read_shape(constants, e, measure) -> Shape``: one element's constants from a grouped table
    (`explicit.time_loop.grouped_tables.grouped`), which only `entry_function` and `entries_function` of that
    module read; what only the step bound needs is not read unless `measure` is 1."""
    Solid: Any
    """Warp struct: moduli and viscosities of one sample."""
    forces: Any
    """``forces(shape, solid, row, ur, uy, vr, vy, measure) -> (f_r, f_y, omega_squared, power, artificial)``:
    corner forces [N], the bound for the stable step [1/s^2] (0 unless `measure` is 1, `INVERTED` if the
    element has turned inside out), the powers dissipated by the solid's damping and by hourglass
    control [W], from the corners' displacements and velocities."""
    energies: Any
    """``energies(shape, solid, row, ur, uy) -> (elastic, hourglass, s)``: stored energies [J], and the
    largest s = sqrt(I1_bar - 3) of the element's stress points [-]."""
    strains: Any
    """``strains(shape, ur, uy) -> (J, s)``: the smallest of det F and its planar part over the stress points
    [-], above 0 in an element that has not turned inside out, and the largest s [-]."""
    stress_point: Any
    """``stress_point(shape, g) -> (weight, gradient_r, gradient_y, hoop)``: volume of the g-th stress point
    [m^3], and what gives the deformation gradient there from the corners' displacements [1/m]."""
    n_points: int
    """Stress points."""


class Element(Protocol):
    """Interface of an element."""

    @property
    def name(self) -> str:
        """The name that `explicit.Model.element` chooses it by."""
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
            Mass density [kg/m^3]; the step bound needs each element's own share of its corners' mass.
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

    Radial entries are 0 on the axis, where a node cannot move outwards.
    """
    inverse = 1.0 / (density * corner_volume)
    return np.where(mesh.on_axis[mesh.quads], 0.0, inverse), inverse
