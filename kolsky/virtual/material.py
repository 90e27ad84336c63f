"""The specification's material: its law, the relaxation, its quasi-static curve."""

from collections.abc import Mapping

from explicit.materials.laws import AnyLaw, law_class
from explicit.relaxation import relaxation_of
from explicit.relaxation.base import RateDependence
from kolsky.schema.material import RelaxationSection


def law_of(name: str, parameters: Mapping[str, float], shear_modulus: float) -> AnyLaw:
    """The quasi-static law.

    Its given constants are scaled to the shear modulus [Pa].

    Raises ValueError if the law is unknown, or if the given constants do not match it or are not allowed.
    """
    kind = law_class(name)
    names = [spec.name for spec in kind.PARAMETERS]
    if set(names) != set(parameters):
        raise ValueError(f"{name} has the constants {', '.join(names)}")
    law = kind.of([parameters[constant] for constant in names])
    return law.scaled(shear_modulus / law.shear_modulus)


def relaxing(declared: RelaxationSection | None) -> tuple[RateDependence, ...]:
    """The relaxation of [relaxation] of a specification; empty without this table."""
    if declared is None:
        return ()
    return (relaxation_of(declared.kind, list(declared.declared().values.values())),)
