"""Figures, one file each; a new one is its file and one line of `REGISTRY`."""

from typing import Any

from kolsky.report.figures import (
    bars_together,
    baseline,
    calibration_pairs,
    calibration_residuals,
    contour,
    corner,
    energy,
    flight_of_view,
    flyer_motion,
    flyer_path,
    flyer_test,
    force,
    force_residual,
    kymograph,
    likelihood,
    lost_points,
    material_fits,
    material_residuals,
    material_stability,
    meshes,
    misfit,
    overlay_epipolar,
    overlay_sigma,
    picture_pair,
    plan_choices,
    plan_information,
    plan_slopes,
    profiles,
    rate_equal_strain,
    rate_forest,
    rate_moduli,
    rate_slope,
    rate_stiffness,
    raw_signals,
    repeats,
    ridge,
    scene,
    sensitivity,
    shape_residual,
    speckle_floor,
    speckle_overlay,
    sweep_effects,
    sweep_indices,
    sweep_maps,
    trend_damping,
    trend_friction,
    trend_poisson,
    trend_stiffness,
    waves,
)
from kolsky.report.figures.base import FigureKind

__all__ = [
    "BARS_TOGETHER",
    "BASELINES",
    "CALIBRATION",
    "FLYER_TESTS",
    "MATERIALS",
    "PLANS",
    "RATES",
    "RECORDINGS",
    "REGISTRY",
    "SENSITIVITY",
    "SPECKLES",
    "SURFACES",
    "SWEEPS",
    "TRENDS",
    "WAVES",
    "FigureKind",
]

REGISTRY: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND
    for module in (
        force,
        shape_residual,
        profiles,
        force_residual,
        misfit,
        contour,
        likelihood,
        ridge,
        corner,
        energy,
        meshes,
        scene,
    )
}
"""Every figure of an identification by name, in the order of its report."""
RECORDINGS: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND for module in (raw_signals, flyer_path, picture_pair)
}
"""Every figure of the recordings behind an identification, before those of `REGISTRY` in its report."""
SURFACES: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND
    for module in (
        overlay_sigma,
        overlay_epipolar,
        lost_points,
        kymograph,
        flyer_motion,
        flight_of_view,
        speckle_overlay,
    )
}
"""Every figure of the surfaces that pictures gave, likewise."""
CALIBRATION: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND for module in (calibration_residuals, calibration_pairs)
}
"""Every figure of a calibration, likewise."""
SPECKLES: dict[str, FigureKind[Any]] = {speckle_floor.KIND.name: speckle_floor.KIND}
"""Every figure of a speckle pattern, likewise."""
WAVES: dict[str, FigureKind[Any]] = {waves.KIND.name: waves.KIND}
"""Every figure of a reduction of bar signals, likewise."""
FLYER_TESTS: dict[str, FigureKind[Any]] = {flyer_test.KIND.name: flyer_test.KIND}
"""Every figure of a flyer test that was reduced by classical means, likewise."""
BARS_TOGETHER: dict[str, FigureKind[Any]] = {bars_together.KIND.name: bars_together.KIND}
"""Every figure of a shot with the bars together, likewise."""
REPEATS: dict[str, FigureKind[Any]] = {repeats.KIND.name: repeats.KIND}
"""Every figure of repeated tests, likewise."""
PLANS: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND for module in (plan_information, plan_slopes, plan_choices)
}
"""Every figure of a plan, likewise."""
RATES: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND for module in (rate_slope, rate_forest, rate_stiffness, rate_equal_strain)
}
"""Every figure of a group of shots whose rates are compared, likewise."""
TRENDS: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND
    for module in (trend_poisson, trend_damping, trend_friction, trend_stiffness)
}
"""Every figure of a shot's trends, Figs. 7 to 10 of Mates et al. (2012), likewise."""
BASELINES: dict[str, FigureKind[Any]] = {baseline.KIND.name: baseline.KIND}
"""Every figure of a quasi-static baseline, likewise."""
MATERIALS: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND for module in (material_fits, material_residuals, material_stability)
}
"""Every figure of laws fitted to homogeneous tests, likewise."""
SENSITIVITY: dict[str, FigureKind[Any]] = {sensitivity.KIND.name: sensitivity.KIND}
"""Every figure of a shot's global sensitivity, likewise."""
SWEEPS: dict[str, FigureKind[Any]] = {
    module.KIND.name: module.KIND for module in (sweep_maps, sweep_effects, sweep_indices)
}
"""Every figure of a design of experiments, likewise."""
MODULI: dict[str, FigureKind[Any]] = {rate_moduli.KIND.name: rate_moduli.KIND}
"""Moduli of tests of every kind on one axis of time, likewise."""
