"""An identification in display units, e.g. damping in µs."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kolsky.inverse.result import Contribution, Estimate, Identification, RouteDifference
from kolsky.inverse.uncertainty_results import PairMap, ParameterProfile, PosteriorSummary
from kolsky.report.nomenclature import factor_of, name_of


def in_display_units(result: Identification) -> Identification:
    """Return a result with every parameter in the unit of `kolsky.report.nomenclature`.

    For pages and figures; files and JSON stay in SI. Apply it once: its result is no longer in SI.
    """
    factors = np.array([factor_of(name) for name in result.design.names])
    design = replace(
        result.design,
        points=result.design.points * factors,
        lower=result.design.lower * factors,
        upper=result.design.upper * factors,
    )
    return replace(
        result,
        estimates={name: estimate_in_display_units(e) for name, e in result.estimates.items()},
        fixed=_scaled(result.fixed),
        routes=tuple(
            replace(
                route,
                parameters=_scaled(route.parameters),
                sigma=_scaled(route.sigma),
                correction=_scaled(route.correction),
                budget=_budget(route.budget),
            )
            for route in result.routes
        ),
        route_difference=None if result.route_difference is None else _difference(result.route_difference),
        methods=tuple(replace(method, values=_scaled(method.values)) for method in result.methods),
        design=design,
        curves=tuple(replace(c, x=c.x * factor_of(c.parameter)) for c in result.curves),
        profiles=tuple(_profile(p, factors) for p in result.profiles),
        ridge=None if result.ridge is None else _ridge(result.ridge),
        systematic=tuple(
            replace(part, shifts=_scaled(part.shifts), moves=_scaled(part.moves))
            for part in result.systematic
        ),
        variations=tuple(replace(other, shifts=_scaled(other.shifts)) for other in result.variations),
        posterior=None if result.posterior is None else _posterior(result.posterior),
    )


def estimate_in_display_units(e: Estimate) -> Estimate:
    """Return one estimate in its display unit."""
    factor = factor_of(e.name)
    return replace(
        e,
        unit=name_of(e.name, e.unit).unit,
        value=e.value * factor,
        sigma_noise=e.sigma_noise * factor,
        sigma_numerical=e.sigma_numerical * factor,
        sigma_systematic=e.sigma_systematic * factor,
        mesh_shift=e.mesh_shift * factor,
        mesh_correction=e.mesh_correction * factor,
        searched=(e.searched[0] * factor, e.searched[1] * factor),
        noise_parts={source: sigma * factor for source, sigma in e.noise_parts.items()},
        numerical_parts={source: sigma * factor for source, sigma in e.numerical_parts.items()},
    )


def _budget(parts: tuple[Contribution, ...]) -> tuple[Contribution, ...]:
    return tuple(replace(part, sigma=_scaled(part.sigma)) for part in parts)


def _difference(d: RouteDifference) -> RouteDifference:
    return RouteDifference(_scaled(d.values), _scaled(d.sigma), _budget(d.budget))


def _profile(p: ParameterProfile, factors: NDArray[np.float64]) -> ParameterProfile:
    factor = factor_of(p.name)
    return replace(
        p,
        values=p.values * factor,
        points=p.points * factors,
        interval=(p.interval[0] * factor, p.interval[1] * factor),
        alone=(p.alone[0] * factor, p.alone[1] * factor),
    )


def _ridge(ridge: PairMap) -> PairMap:
    first, second = (factor_of(name) for name in ridge.names)
    return replace(ridge, x=ridge.x * first, y=ridge.y * second)


def _posterior(chains: PosteriorSummary) -> PosteriorSummary:
    factors = np.array([factor_of(name) for name in chains.names])
    named = {name: getattr(chains, name) * factors for name in ("samples", "median", "lower", "upper")}
    return replace(chains, **named)


def _scaled(values: Mapping[str, float]) -> dict[str, float]:
    return {name: value * factor_of(name) for name, value in values.items()}
