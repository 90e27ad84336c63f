"""The parameters a simulation of a shot can vary, by name; one line here makes a new one free everywhere."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from doe import Box
from kolsky.shot.records import Shot


@dataclass(frozen=True)
class Parameter:
    """One parameter of the simulated test."""

    name: str
    """Name at the API and the command line; also the field of `explicit.Samples`."""
    symbol: str
    """Symbol in formulas and figures."""
    unit: str
    """Unit, "1" if none."""
    lower: float
    """Lower bound of the default design."""
    upper: float
    """Upper bound of the default design."""
    allowed: tuple[float, float]
    """Range outside which a value is refused."""
    held: Callable[[Shot], float]
    """The value a shot declares for it."""


PARAMETERS: dict[str, Parameter] = {
    p.name: p
    for p in (
        Parameter("stiffness_factor", "m", "1", 0.75, 1.5, (1e-3, 1e3), lambda shot: 1.0),
        Parameter("friction", "f", "1", 0.0, 2.0, (0.0, 1e3), lambda shot: shot.interface.friction),
        Parameter("poisson", "nu", "1", 0.49, 0.4999, (0.0, 0.4999), lambda shot: shot.model.poisson),
        Parameter("damping", "beta", "s", 0.0, 1e-4, (0.0, 1e-2), lambda shot: shot.model.damping),
        Parameter(
            "mass_damping", "alpha", "1/s", 0.0, 100.0, (0.0, 1e6), lambda shot: shot.model.mass_damping
        ),
        Parameter(
            "release_stress",
            "sigma_b",
            "Pa",
            0.0,
            2e5,
            (0.0, 1e9),
            lambda shot: shot.interface.release_stress,
        ),
    )
}


def parameter(name: str) -> Parameter:
    """Look a parameter up.

    Raises
    ------
    ValueError
        If there is no such parameter; the message lists those there are.
    """
    if name not in PARAMETERS:
        raise ValueError(f"there is no parameter {name!r}; choose from {', '.join(PARAMETERS)}")
    return PARAMETERS[name]


def checked_value(name: str, value: float) -> float:
    """A value inside the parameter's allowed range.

    Raises
    ------
    ValueError
        If it is outside; the message names value, range and unit.
    """
    p = parameter(name)
    low, high = p.allowed
    if not low <= value <= high:
        unit = "" if p.unit == "1" else f" {p.unit}"
        raise ValueError(
            f"{name} = {value:.9g}{unit} is not allowed; it must be in [{low:g}, {high:g}]{unit}"
        )
    return float(value)


def design_box(bounds: Mapping[str, tuple[float, float] | None]) -> Box:
    """The box of a design: given bounds, or the default ones where a bound is None.

    Raises
    ------
    ValueError
        If a name is unknown, a bound is outside the allowed range or the bounds are not ascending.
    """
    filled = {}
    for name, pair in bounds.items():
        p = parameter(name)
        low, high = pair if pair is not None else (p.lower, p.upper)
        filled[name] = (checked_value(name, low), checked_value(name, high))
        if not low < high:
            raise ValueError(f"{name}: the lower bound {low:.9g} must be below the upper bound {high:.9g}")
    return Box.of(filled)
