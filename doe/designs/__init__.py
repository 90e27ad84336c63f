"""Designs of experiments: points of a box for the runs. A new design is one file and one line of
`DESIGNS`."""

from doe.designs.design import Design, DesignKind, Rng
from doe.designs.optimal import d_optimal
from doe.designs.response_surface import box_behnken, central_composite, fractional_factorial
from doe.designs.space_filling import from_points, full_factorial, halton, latin_hypercube, maximin, sobol

DESIGNS: dict[str, DesignKind] = {
    "factorial": DesignKind(full_factorial, ("levels",)),
    "lhs": DesignKind(latin_hypercube, ("runs", "rng")),
    "maximin": DesignKind(maximin, ("runs", "rng")),
    "sobol": DesignKind(sobol, ("runs", "rng")),
    "halton": DesignKind(halton, ("runs", "rng")),
    "fractional": DesignKind(fractional_factorial, ("generators",)),
    "composite": DesignKind(central_composite, ()),
    "box-behnken": DesignKind(box_behnken, ()),
    "d-optimal": DesignKind(d_optimal, ("runs", "rng", "candidates")),
    "csv": DesignKind(from_points, ("points",)),
}
"""Designs by their names at a command line, in the order of its help."""

__all__ = [
    "DESIGNS",
    "Design",
    "DesignKind",
    "Rng",
    "box_behnken",
    "central_composite",
    "d_optimal",
    "fractional_factorial",
    "from_points",
    "full_factorial",
    "halton",
    "latin_hypercube",
    "maximin",
    "sobol",
]
