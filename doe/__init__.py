"""Designs, surrogates, search and uncertainty for a function of named parameters in a box; no physics.

The names below are loaded when they are first used.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from doe.box import Box
    from doe.designs import DESIGNS, Design, DesignKind, from_points, full_factorial, latin_hypercube, sobol
    from doe.ledger import Ledger, run_chunks
    from doe.search import SearchOutcome, SearchResult, nelder_mead
    from doe.sensitivity import morris, sobol_indices
    from doe.surrogates import (
        SURROGATES,
        CostSurrogate,
        ProcessSurrogate,
        QuadraticSurrogate,
        ResponseSurrogate,
        Surrogate,
    )
    from doe.uncertainty import Channel, Likelihood, profile_likelihoods, sample_posterior, verdicts

_HOME = {
    "DESIGNS": "doe.designs",
    "SURROGATES": "doe.surrogates",
    "Box": "doe.box",
    "Channel": "doe.uncertainty",
    "CostSurrogate": "doe.surrogates",
    "Design": "doe.designs",
    "DesignKind": "doe.designs",
    "Ledger": "doe.ledger",
    "Likelihood": "doe.uncertainty",
    "ProcessSurrogate": "doe.surrogates",
    "QuadraticSurrogate": "doe.surrogates",
    "ResponseSurrogate": "doe.surrogates",
    "SearchOutcome": "doe.search",
    "SearchResult": "doe.search",
    "Surrogate": "doe.surrogates",
    "from_points": "doe.designs",
    "full_factorial": "doe.designs",
    "latin_hypercube": "doe.designs",
    "morris": "doe.sensitivity",
    "nelder_mead": "doe.search",
    "profile_likelihoods": "doe.uncertainty",
    "run_chunks": "doe.ledger",
    "sample_posterior": "doe.uncertainty",
    "sobol": "doe.designs",
    "sobol_indices": "doe.sensitivity",
    "verdicts": "doe.uncertainty",
}
"""Module of each public name. The imports above repeat this list for type checkers; a test compares both."""

__all__ = [*_HOME]


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'doe' has no attribute {name!r}; it offers {', '.join(_HOME)}")
    from importlib import import_module

    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
