"""What a compression gives: force, shape and their derivatives; or that there is no equilibrium."""

from dataclasses import dataclass

from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class Compression:
    """Force and shape of a compressed cylinder at chosen strains."""

    strain: FloatArray
    """Nominal compressive strain [-], shape [n]."""
    stress: FloatArray
    """Force over the undeformed section [Pa], compression positive, shape [n]."""
    bulge: FloatArray
    """Radius at mid-height [m], shape [n]."""
    stress_by: FloatArray
    """Derivatives of the stress by the parameters, shape [n, n_parameters]."""
    bulge_by: FloatArray
    """Derivatives of the radius [m], shape [n, n_parameters]."""
    outline: FloatArray
    """Places r, z of the nodes of the side's upper half [m], shape [n, n_side, 2]."""
    largest_s: float
    """Largest sqrt(I1 - 3) of any Gauss point at the last strain [-]."""
    past: float
    """Share of the volume that is strained past the homogeneous strain of the last point [-]."""
    steps: int = 0
    """Equilibria found."""
    snaps: int = 0
    """Places where the body jumped to another equilibrium: a node of its edge landed or curled off."""


class NoEquilibriumError(ValueError):
    """No equilibrium was found; the message says at which strain."""
