"""Material laws, one file each; a new law is a class with the methods of `MaterialLaw`."""

from explicit.materials.base import MaterialLaw
from explicit.materials.marlow import MarlowLaw, marlow_from_curve, neo_hookean
from explicit.materials.volumetric import bulk_modulus

__all__ = ["MarlowLaw", "MaterialLaw", "bulk_modulus", "marlow_from_curve", "neo_hookean"]
