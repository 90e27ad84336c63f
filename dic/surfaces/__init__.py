"""Surfaces in the test frame: cylinder, outline, symmetry, strains, noise floors."""

from dic.surfaces.convert import referenced, static_mean, to_surface
from dic.surfaces.cylinder import Cylinder, fit_cylinder
from dic.surfaces.frame import SpecimenFrame, on_cylinder, test_frame
from dic.surfaces.outline import outline
from dic.surfaces.overlap import overlap_factor
from dic.surfaces.strains import StrainGauge, StrainOutcome, strains
from dic.surfaces.symmetry import axisymmetry

__all__ = [
    "Cylinder",
    "SpecimenFrame",
    "StrainGauge",
    "StrainOutcome",
    "axisymmetry",
    "fit_cylinder",
    "on_cylinder",
    "outline",
    "overlap_factor",
    "referenced",
    "static_mean",
    "strains",
    "test_frame",
    "to_surface",
]
