"""Surrogates of expensive functions of a box. A new one is one file and one line in `SURROGATES`."""

from typing import Any

from doe.surrogates.cost import CostSurrogate
from doe.surrogates.kernels import DEFAULT_KERNELS, Kernel, SurrogateError
from doe.surrogates.pca import PrincipalComponents
from doe.surrogates.process import ProcessSurrogate
from doe.surrogates.protocol import Surrogate
from doe.surrogates.quadratic import QuadraticSurrogate
from doe.surrogates.rbf import Candidate, RadialBasis
from doe.surrogates.response import ResponseSurrogate

SURROGATES: dict[str, Any] = {
    "response": ResponseSurrogate,
    "process": ProcessSurrogate,
    "quadratic": QuadraticSurrogate,
    "cost": CostSurrogate,
}
"""Surrogate classes by name; each has `fit(box, points, values, ...)` and offers `Surrogate`."""

__all__ = [
    "DEFAULT_KERNELS",
    "SURROGATES",
    "Candidate",
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
