"""Designs of experiments: points of a box for the runs. A new design is one file and one line of
`DESIGNS`."""

from doe.designs.design import Design, DesignKind, Rng
from doe.designs.optimal import d_optimal
from doe.designs.response_surface import box_behnken, central_composite, fractional_factorial
from doe.designs.space_filling import from_points, full_factorial, halton, latin_hypercube, maximin, sobol

DESIGNS: dict[str, DesignKind] = {
    kind.function.__name__: kind
    for kind in (
        DesignKind(full_factorial, "factorial", ("levels",)),
        DesignKind(latin_hypercube, "lhs", ("runs", "rng")),
        DesignKind(maximin, "maximin", ("runs", "rng")),
        DesignKind(sobol, "sobol", ("runs", "rng")),
        DesignKind(halton, "halton", ("runs", "rng")),
        DesignKind(fractional_factorial, "fractional", ("generators",)),
        DesignKind(central_composite, "composite", ()),
        DesignKind(box_behnken, "box-behnken", ()),
        DesignKind(d_optimal, "d-optimal", ("runs", "rng", "candidates")),
        DesignKind(from_points, "csv", ("points",)),
    )
}
"""Designs by the name of their function, in the order of a command line's help."""

__all__ = [
    "DESIGNS",
    "Design",
    "DesignKind",
    "Rng",
    "box_behnken",
    "central_composite",
    "d_optimal",
    "design_kind",
    "fractional_factorial",
    "from_points",
    "full_factorial",
    "halton",
    "latin_hypercube",
    "maximin",
    "sobol",
]


def design_kind(option: str) -> DesignKind:
    """Find a design by its name at a command line."""
    for kind in DESIGNS.values():
        if kind.option == option:
            return kind
    options = ", ".join(kind.option for kind in DESIGNS.values())
    raise ValueError(f"there is no design {option!r}; choose from {options}")
