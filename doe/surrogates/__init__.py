"""Surrogates of expensive functions of a box. A new surrogate is one file and one line in `SURROGATES`."""

from typing import Any

from doe.surrogates.pca import PrincipalComponents
from doe.surrogates.process import ProcessSurrogate
from doe.surrogates.protocol import DEFAULT_KERNELS, ComponentSurrogate, Kernel, Surrogate, SurrogateError
from doe.surrogates.quadratic import QuadraticSurrogate
from doe.surrogates.rbf import CostSurrogate, RadialBasis, ResponseSurrogate

SURROGATES: dict[str, Any] = {
    "response": ResponseSurrogate,
    "process": ProcessSurrogate,
    "quadratic": QuadraticSurrogate,
}
"""Surrogates by name. ``fit(box, points, values, scale=...)`` of a class builds a `Surrogate` from runs,
shapes [n, d] and [n, k]; ``scale``: scale of differences in each entry, shape [k] or a number."""

__all__ = [
    "DEFAULT_KERNELS",
    "SURROGATES",
    "ComponentSurrogate",
    "CostSurrogate",
    "Kernel",
    "PrincipalComponents",
    "ProcessSurrogate",
    "QuadraticSurrogate",
    "RadialBasis",
    "ResponseSurrogate",
    "Surrogate",
    "SurrogateError",
]
