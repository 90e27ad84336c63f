"""Fields that colour the specimen; a new one is one function and one line of `FIELDS`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kolsky.base.arrays import FloatArray

if TYPE_CHECKING:
    from explicit.materials.volumetric import VolumetricLaw
    from kolsky.base.records import MaterialCurve
    from kolsky.inverse.result import Identification


@dataclass(frozen=True)
class Solid:
    """Material of the specimen, needed for stresses and energies."""

    law: Any
    """`explicit.materials.MaterialLaw`, unscaled."""
    volume: VolumetricLaw
    """Volumetric law, unscaled."""
    stiffness_factor: float
    """Factor on both."""


def solid_of(curve: MaterialCurve, result: Identification) -> Solid:
    """Return the material of an identification: the law of its reference curve times the stiffness factor."""
    from explicit.materials.volumetric import VolumetricLaw, bulk_modulus
    from kolsky.inverse.forward import material_law

    law = material_law(curve)
    values = {**result.fixed, **{name: e.value for name, e in result.estimates.items()}}
    return Solid(
        law=law,
        volume=VolumetricLaw(float(bulk_modulus(law.initial_shear_modulus, values["poisson"]))),
        stiffness_factor=values["stiffness_factor"],
    )


@dataclass(frozen=True)
class FieldKind:
    """Scalar field with one value per element."""

    label: str
    """Quantity with its unit, as on an axis."""
    values: Callable[[FloatArray, Solid | None], FloatArray]
    """From deformation gradients, shape [..., 3, 3] in (r, y, hoop), and the solid; shape [...]."""
    colours: str
    """Name of a Matplotlib colour map."""
    needs_solid: bool = False
    """True if the material must be known."""


def smallest_stretch(F: FloatArray, solid: Solid | None = None) -> FloatArray:
    """Smallest principal stretch [-].

    The hoop stretch or the smaller of the two in the meridian plane, whose squares are the eigenvalues of
    F^T F there.
    """
    r, y = F[..., :2, 0], F[..., :2, 1]
    # Sums of two, written out: a loop over so short an axis takes ten times as long, to the same bits.
    (r0, r1), (y0, y1) = np.moveaxis(r, -1, 0), np.moveaxis(y, -1, 0)
    rr, yy, ry = r0**2 + r1**2, y0**2 + y1**2, r0 * y0 + r1 * y1
    in_plane = 0.5 * (rr + yy) - np.hypot(0.5 * (rr - yy), ry)
    # Below zero only by round-off, where an element is flattened.
    return np.asarray(np.minimum(np.sqrt(np.maximum(in_plane, 0.0)), np.abs(F[..., 2, 2])))


def pressure(F: FloatArray, solid: Solid | None) -> FloatArray:
    """Minus the mean Cauchy stress [MPa]."""
    assert solid is not None  # `needs_solid`
    return np.asarray(-1e-6 * solid.stiffness_factor * solid.volume.pressure(np.linalg.det(F)))


def strain_energy(F: FloatArray, solid: Solid | None) -> FloatArray:
    """Stored energy per undeformed volume [MJ/m^3]."""
    assert solid is not None  # `needs_solid`
    J = np.linalg.det(F)
    b = np.einsum("...ij,...kj->...ik", F, F)
    components = np.stack([b[..., 0, 0], b[..., 1, 1], b[..., 0, 1], b[..., 2, 2]], axis=-1)
    b_bar = J[..., None] ** (-2.0 / 3.0) * components
    return np.asarray(1e-6 * solid.stiffness_factor * (solid.law.energy(b_bar) + solid.volume.energy(J)))


FIELDS: dict[str, FieldKind] = {
    "stretch": FieldKind("Smallest stretch (1)", smallest_stretch, "viridis"),
    "pressure": FieldKind("Pressure (MPa)", pressure, "cividis", needs_solid=True),
    "energy": FieldKind("Strain energy (MJ/m³)", strain_energy, "viridis", needs_solid=True),
}
"""Fields by name."""
