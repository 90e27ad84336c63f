"""Surrogates of expensive functions of a box. A new surrogate is one file and one line in `SURROGATES`."""

from doe.surrogates.pca import PrincipalComponents
from doe.surrogates.process import ProcessSurrogate
from doe.surrogates.protocol import (
    DEFAULT_KERNELS,
    ComponentSurrogate,
    Kernel,
    Surrogate,
    SurrogateError,
    SurrogateKind,
)
from doe.surrogates.quadratic import QuadraticSurrogate
from doe.surrogates.rbf import CostSurrogate, RadialBasis, ResponseSurrogate

SURROGATES: dict[str, SurrogateKind] = {
    "response": SurrogateKind(ResponseSurrogate, "radial basis functions of principal components"),
    "process": SurrogateKind(ProcessSurrogate, "Gaussian processes of principal components"),
    "quadratic": SurrogateKind(QuadraticSurrogate, "a polynomial of the second degree, by least squares"),
    "cost": SurrogateKind(CostSurrogate, "radial basis functions of one number", scalar=True),
}
"""Surrogates by name; the `fit` of each one builds an object with the interface `Surrogate`."""

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
    "SurrogateKind",
]
