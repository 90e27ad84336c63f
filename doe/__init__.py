"""Designs, surrogates, search: a box of named parameters and a function, no physics."""

from doe.box import Box
from doe.designs import DESIGNS, Design, from_points, full_factorial, latin_hypercube, sobol
from doe.multistart import multi_start
from doe.outcome import SearchOutcome
from doe.search import SearchResult, nelder_mead
from doe.surrogates import SURROGATES, CostSurrogate, ResponseSurrogate, Surrogate

__all__ = [
    "DESIGNS",
    "SURROGATES",
    "Box",
    "CostSurrogate",
    "Design",
    "ResponseSurrogate",
    "SearchOutcome",
    "SearchResult",
    "Surrogate",
    "from_points",
    "full_factorial",
    "latin_hypercube",
    "multi_start",
    "nelder_mead",
    "sobol",
]
