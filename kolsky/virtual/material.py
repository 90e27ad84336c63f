"""The specification's material: its law, the relaxation, its quasi-static curve."""

from collections.abc import Mapping, Sequence

from explicit.materials.laws import AnyLaw, law_class
from explicit.relaxation.base import RateDependence
from explicit.relaxation.bergstrom_boyce import BergstromBoyce
from explicit.relaxation.prony import PronySeries
from kolsky.base.apparatus import Relaxation


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


def relaxation_of(strengths: Sequence[float], times: Sequence[float]) -> tuple[PronySeries, ...]:
    """The relaxation of the material; empty without relaxation.

    Raises ValueError if the numbers of strengths and times differ.
    """
    series = PronySeries(tuple(strengths), tuple(times))
    return (series,) if len(series) else ()


def what_relaxes(
    declared: Relaxation | None, strengths: Sequence[float], times: Sequence[float]
) -> tuple[RateDependence, ...]:
    """The relaxation of a specimen; empty without relaxation.

    ``declared``: from [relaxation] of its specification. ``strengths``, ``times``: from its [material]. They
    are used without [relaxation]. Raises ValueError if the constants are not allowed.
    """
    if declared is None:
        return relaxation_of(strengths, times)
    constants = list(declared.values.values())
    if declared.kind == "bergstrom_boyce":
        return (BergstromBoyce(*constants),)
    return relaxation_of(constants[: declared.branches], constants[declared.branches :])
