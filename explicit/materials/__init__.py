"""Material laws, one file each; `explicit.materials.law` explains how to add one."""

from explicit.materials.law import MaterialLaw
from explicit.materials.laws import LAWS, AnyLaw, law_class
from explicit.materials.laws.marlow import MarlowLaw, marlow_from_curve, neo_hookean
from explicit.materials.volumetric import bulk_modulus

__all__ = [
    "LAWS",
    "AnyLaw",
    "MarlowLaw",
    "MaterialLaw",
    "bulk_modulus",
    "law_class",
    "marlow_from_curve",
    "neo_hookean",
]
