"""What a surface is: cylinder, test frame, outline, symmetry, strains."""

from dic.surfaces.convert import referenced, static_mean, to_surface
from dic.surfaces.cylinder import Cylinder, fit_cylinder
from dic.surfaces.frame import SpecimenFrame, on_cylinder, test_frame
from dic.surfaces.overlap import overlap_factor

__all__ = [
    "Cylinder",
    "SpecimenFrame",
    "fit_cylinder",
    "on_cylinder",
    "overlap_factor",
    "referenced",
    "static_mean",
    "test_frame",
    "to_surface",
]
