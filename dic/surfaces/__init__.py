"""Surfaces in the test frame: cylinder, outline, strains, noise floors."""

from dic.correlation.subsets import overlap_factor
from dic.surfaces.cylinder import Cylinder, SpecimenFrame, fit_cylinder, on_cylinder, test_frame
from dic.surfaces.outline import outline
from dic.surfaces.strains import StrainGauge, StrainOutcome, strains
from dic.surfaces.surface_history import referenced, static_mean, to_surface

__all__ = [
    "Cylinder",
    "SpecimenFrame",
    "StrainGauge",
    "StrainOutcome",
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
