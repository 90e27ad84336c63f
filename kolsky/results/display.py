"""An identification as it is shown: display units (damping in microseconds), words and digits of its
records."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kolsky.inverse.result import (
    Contribution,
    Estimate,
    Identification,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    RouteDifference,
)
from kolsky.results.nomenclature import factor_of, name_of


def in_display_units(result: Identification) -> Identification:
    """Return a result with every parameter in the unit of `kolsky.results.nomenclature`.

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


RECORDED_LABELS = {
    "specimen.diameter": "diameter",
    "specimen.length": "length",
    "specimen.density": "density",
    "specimen_length.declared": "length, declared",
    "specimen_length.declared_sigma": "length, declared, standard uncertainty",
    "specimen_length.pictures": "length in the pictures",
    "specimen_length.pictures_sigma": "length in the pictures, standard uncertainty",
    "specimen_length.used": "length, used",
    "specimen_length.used_sigma": "length, used, standard uncertainty",
    "specimen_length.y_shift": "outline’s heights, shifted by",
    "specimen_length.y_sigma": "outline’s heights, standard uncertainty at a known length",
    "specimen_length.y_per_length": "error of the heights over that of the length",
    "interface.faces": "interface, end faces",
    "interface.side": "interface, side surface",
    "declared_interface.faces": "the shot declares, end faces",
    "declared_interface.side": "the shot declares, side surface",
    "support": "transmission side",
    "window_s": "simulated window",
    "flyer_chi2_per_dof": "flyer fit, χ² per degree of freedom",
    "flyer_noise_scale": "flyer noise, used over declared",
    "flyer_static_scatter": "flyer noise, static frames over declared",
    "front_noise_scale": "front face’s velocity, noise used over declared",
    "front_sigma_gain": "front face’s velocity, standard uncertainty of its scale",
    "force_noise_correlation": "force noise, correlation of neighbouring samples",
    "force_baseline_samples": "force noise, samples it is from",
    "window_end": "end of the window",
    "symmetry_end": "end of symmetry by the flyer’s flight",
    "hold": "held at the shot’s value",
    "curve_last_s": "quasi-static curve, last √(Ī₁ − 3)",
    "curve_last_strain": "quasi-static curve, last nominal strain",
    "numerics.mesh": "mesh of the surrogate",
    "numerics.grading": "mesh, largest over smallest element",
    "numerics.safety": "time step over the stable one",
    "numerics.precision": "arithmetic",
    "numerics.device": "device",
    "numerics.threads": "threads",
    "numerics.past_data": "past the quasi-static curve",
    "numerics.element": "element",
    "numerics.hourglass_form": "hourglass control",
    "numerics.compressible": "Poisson’s ratio corrected from",
    "refined_mesh": "refined mesh",
    "replicates": "replicates of the input noise",
    "replicate_mesh": "mesh of the replicates",
    "bayes": "posterior sampled",
    "seed": "seed of random draws",
    "machine": "processor",
    "recordings.force_from": "force from",
    "recordings.channel": "channel of the recorder",
    "recordings.sampling_interval_s": "sampling interval",
    "recordings.baseline_s": "baseline",
    "recordings.baseline_V": "mean of the baseline, subtracted",
    "recordings.noise_V": "noise of a sample, from the baseline",
    "recordings.sensitivity_V_per_N": "sensitivity",
    "recordings.compression": "compression gives",
    "recordings.clock_offset_s": "clock, shot’s minus recorder’s",
    "recordings.frames": "frames with a flyer displacement",
    "recordings.flyer_sigma_m": "noise of a flyer displacement, median",
    "recordings.front_noise_m_per_s": "noise of the front face’s velocity",
    "recordings.front_samples": "samples of the front face’s velocity",
    "recordings.window_start_s": "window, first time",
    "recordings.window_end_s": "window, last time",
    "recordings.symmetry_end_s": "end of symmetry by the flyer’s flight",
}
"""Words for the dotted keys of provenance; other keys are shown unchanged."""

RECORDED_UNITS = {
    "specimen.diameter": (1e3, "mm"),
    "specimen.length": (1e3, "mm"),
    "specimen.density": (1.0, "kg/m³"),
    "specimen_length.declared": (1e3, "mm"),
    "specimen_length.declared_sigma": (1e6, "µm"),
    "specimen_length.pictures": (1e3, "mm"),
    "specimen_length.pictures_sigma": (1e6, "µm"),
    "specimen_length.used": (1e3, "mm"),
    "specimen_length.used_sigma": (1e6, "µm"),
    "specimen_length.y_shift": (1e6, "µm"),
    "specimen_length.y_sigma": (1e6, "µm"),
    "window_s": (1e3, "ms"),
    "window_end": (1e3, "ms"),
    "symmetry_end": (1e3, "ms"),
    "recordings.sampling_interval_s": (1e6, "µs"),
    "recordings.baseline_s": (1e3, "ms"),
    "recordings.baseline_V": (1e3, "mV"),
    "recordings.noise_V": (1e3, "mV"),
    "recordings.sensitivity_V_per_N": (1e3, "mV/N"),
    "recordings.clock_offset_s": (1e6, "µs"),
    "recordings.flyer_sigma_m": (1e6, "µm"),
    "recordings.front_noise_m_per_s": (1.0, "m/s"),
    "recordings.window_start_s": (1e3, "ms"),
    "recordings.window_end_s": (1e3, "ms"),
    "recordings.symmetry_end_s": (1e3, "ms"),
}
"""Factor and unit in which an SI entry of provenance is shown."""

RECORDED_LISTS = {
    "window_s": " to ",
    "recordings.baseline_s": " to ",
    "numerics.mesh": " × ",
    "refined_mesh": " × ",
    "replicate_mesh": " × ",
}
"""Separator of the numbers of a list; a comma otherwise."""

RECORDED_DEFAULTS = {"numerics.threads": "all cores", "numerics.compressible": "none, run directly"}
"""Text for a value of None."""

RECORDED_DIGITS = {
    "window_s": 4,
    "window_end": 4,
    "symmetry_end": 4,
    "specimen_length.declared_sigma": 2,
    "specimen_length.pictures": 5,
    "specimen_length.pictures_sigma": 2,
    "specimen_length.used": 5,
    "specimen_length.used_sigma": 2,
    "specimen_length.y_shift": 2,
    "specimen_length.y_sigma": 2,
    "specimen_length.y_per_length": 2,
    "flyer_chi2_per_dof": 3,
    "flyer_noise_scale": 3,
    "flyer_static_scatter": 2,
    "front_noise_scale": 3,
    "front_sigma_gain": 2,
    "force_noise_correlation": 2,
    "curve_last_s": 3,
    "curve_last_strain": 3,
    "recordings.baseline_V": 3,
    "recordings.noise_V": 3,
    "recordings.flyer_sigma_m": 3,
    "recordings.window_start_s": 4,
    "recordings.window_end_s": 4,
}
"""Significant digits of a number; six otherwise."""

QUALITY = {
    "loo_force": ("force, leave-one-out, rms", 1.0, " N"),
    "loo_shape": ("outline, leave-one-out, rms", 1e6, " µm"),
    "check_shift_sigmas": ("optimum moved by the last check run", 1.0, " σ"),
    "check_force": ("force, against the last check run, rms", 1.0, " N"),
    "check_shape": ("outline, against the last check run, rms", 1e6, " µm"),
    "runs_needed": ("runs around the optimum that would do", 1.0, ""),
    "lost_mesh_runs": ("runs lost that were to tell the mesh’s error", 1.0, ""),
    "counted_points": ("outline points counted in the search", 1.0, ""),
    "force_discrepancy": ("discrepancy of the model, force", 1.0, " N"),
    "shape_discrepancy": ("discrepancy of the model, outline", 1e6, " µm"),
    "slow_discrepancy": ("common to many points of the outline", 1e6, " µm"),
    "branch_probability": ("planted elastic data that a weak branch improves as much", 1.0, ""),
    "branch_strength": ("strength of the branch that was searched for", 1.0, ""),
    "branch_time": ("its relaxation time", 1e6, "µs"),
    "branch_share": ("share of what is left that it explains", 1.0, ""),
    "branch_aic": ("Akaike’s criterion with it, less that without", 1.0, ""),
    "valley_margin": ("next valley of Poisson’s ratio, −2 ln L above this one", 1.0, ""),
    "front_moved": ("front face’s path moved by, over its noise, rms", 1.0, ""),
}
"""Words, factor and unit of the entries of `Identification.surrogate`."""


def recorded_label(key: str) -> str:
    """Return the words for a dotted key; "free.damping" and "held.damping" name the parameter."""
    kind, dot, name = key.partition(".")
    if dot and kind in ("free", "held"):
        known = name_of(name)
        return f"{kind}: {known.words.split(',')[0]}" + (f" {known.symbol}" if known.symbol != name else "")
    return RECORDED_LABELS.get(key, key)


def recorded_value(key: str) -> tuple[float, str, str, str, int]:
    """Return how a value is shown: factor, unit, separator of a list, text for None, significant digits."""
    factor, unit = RECORDED_UNITS.get(key, (1.0, ""))
    kind, dot, name = key.partition(".")
    if dot and kind in ("free", "held"):
        unit = "" if name_of(name).unit in ("1", "SI") else name_of(name).unit
        return factor_of(name), unit, " to ", "default bounds", 6
    return (
        factor,
        unit,
        RECORDED_LISTS.get(key, ", "),
        RECORDED_DEFAULTS.get(key, "default"),
        RECORDED_DIGITS.get(key, 6),
    )
