"""The specification's material: its law, what relaxes, its quasi-static curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from explicit.materials.laws import AnyLaw, law_class
from explicit.relaxation.prony import PronySeries
from kolsky.base.arrays import FloatArray

if TYPE_CHECKING:
    from kolsky.virtual.schema import MaterialTable


def law_of(material: MaterialTable) -> AnyLaw:
    """The quasi-static law: the constants as given, scaled to the shear modulus.

    Raises
    ------
    ValueError
        If the law is unknown, or its constants are not those given or cannot be.
    """
    kind = law_class(material.law)
    names = [spec.name for spec in kind.PARAMETERS]
    if set(names) != set(material.parameters):
        raise ValueError(f"{material.law} has the constants {', '.join(names)}")
    law = kind.of([material.parameters[name] for name in names])
    return law.scaled(material.shear_modulus / law.shear_modulus)


def relaxation_of(material: MaterialTable) -> tuple[PronySeries, ...]:
    """What relaxes beside the law; empty if nothing does.

    Raises
    ------
    ValueError
        If strengths and times do not belong together.
    """
    series = PronySeries(material.prony_strengths, material.prony_times)
    return (series,) if len(series) else ()


def uniaxial_stress(law: AnyLaw, stretch: FloatArray) -> FloatArray:
    """Nominal stress of an incompressible cylinder that is free to expand [Pa], of the stretch's shape.

    P = (lam_1 dW/dlam_1 - lam_2 dW/dlam_2) / lam_1 with lam_2 = lam_1^(-1/2).
    """
    across = stretch**-0.5
    along, side, _ = law.principal(stretch, across, across)
    return np.asarray(along - side * across / stretch)
