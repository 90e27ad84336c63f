"""Figures of every page.

A new figure is its function and its name in one of the registries of `PLACES`.
"""

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any

from kolsky.report.figures.base import FigureKind

Registry = Mapping[str, FigureKind[Any]]
"""Figures of one page by name, in the order in which the page shows them."""


def by_name(figures: Iterable[FigureKind[Any]]) -> Registry:
    """Return figures as a registry; ValueError if two have the same name."""
    registry: dict[str, FigureKind[Any]] = {}
    for kind in figures:
        if kind.name in registry:
            raise ValueError(f"two figures of one page are called {kind.name!r}; rename one of them")
        registry[kind.name] = kind
    return registry


PLACES: dict[str, tuple[str, ...]] = {
    "JOINT": ("kolsky.inverse.joint_result.JointResult", "rates: joint_shots joint_curve"),
    "RECORDINGS": (
        "kolsky.shot.recordings.ShotRecordings",
        "recordings: raw_signals flyer_path picture_pair",
    ),
    "REGISTRY": (
        "kolsky.inverse.result.Identification",
        "comparison: force outline profiles shape_residual",
        "misfit: likelihood ridge corner misfit",
        "comparison: energy scene",
    ),
    "SURFACES": (
        "kolsky.report.picture_views.SurfaceView",
        "surfaces: surface_fields overlay_sigma overlay_epipolar lost_points kymograph flyer flight speckles",
    ),
    "CALIBRATION": (
        "dic.calibration.views.Calibration",
        "calibration: calibration_residuals calibration_pairs",
    ),
    "CHECKS": ("kolsky.shot.records.Shot", "recordings: checked_shot checked_curve"),
    "PICTURE_CHECKS": ("kolsky.shot.records.PicturedShot", "recordings: checked_pictures checked_curve"),
    "BAR_CHECKS": ("kolsky.shot.bars.CheckedBars", "waves: checked_bars"),
    "SPECKLES": ("dic.chain.remarks.Speckles", "surfaces: speckle_floor"),
    "WAVES": ("kolsky.bars.records.WavesResult", "waves: waves"),
    "FLYER_TESTS": ("kolsky.bars.records.FlyerResult", "waves: flyer_test"),
    "FULL_FIELDS": ("kolsky.report.picture_views.FullFieldView", "surfaces: full_field histories"),
    "BARS_TOGETHER": ("kolsky.bars.guides.propagation.BarsTogether", "waves: bars_together"),
    "REPEATS": ("kolsky.bars.reduction.repeated_tests.RepeatedTests", "waves: repeats"),
    "PLANS": ("kolsky.studies.planning.plan.Plan", "planning: plan_information plan_slopes plan_choices"),
    "PREDICTIONS": ("kolsky.prediction.predict.Prediction", "planning: signals"),
    "SCANS": ("", "planning: scan"),
    "RATES": (
        "kolsky.studies.rates.records.GroupRates",
        "rates: rate_slope rate_forest rate_stiffness rate_equal_strain",
    ),
    "BASELINES": ("kolsky.material.reference_curve.ReferenceCurve", "material: baseline"),
    "MATERIALS": (
        "kolsky.material.fits.compare.Comparison",
        "material: material_fits material_residuals material_stability",
    ),
    "SWEEPS": (
        "kolsky.studies.sweep_analysis.SweepAnalysis",
        "studies: sweep_maps sweep_effects sweep_forces sweep_indices",
    ),
    "BUDGETS": ("kolsky.studies.budget.records.Budget", "studies: budget"),
    "RELAXATIONS": (
        "kolsky.studies.rate_dependence.SlowDynamics",
        "material: relaxation_moduli relaxation_holds relaxation_oscillation relaxation_shifts",
    ),
    "SPECIMENS": ("kolsky.report.body_views.SpecimenView", "bodies: forces correlations strains mesh"),
    "SHEETS": ("kolsky.report.body_views.SheetView", "bodies: sheet_histories sheet_steps sheet_fields"),
    "ACTUATORS": ("kolsky.report.body_views.ActuatorView", "bodies: shapes bend markers loop"),
}
"""For each registry the class of the results in its figures, and files with their figures in the order of its
page. A file is loaded when one of its registries is needed, because a command makes one page."""

SHOWN_BY = {shown: name for name, (shown, *_) in PLACES.items() if shown}
"""Registries by the class of the results in their figures."""

__all__ = ["SHOWN_BY", "FigureKind", "figures_of", *PLACES]


def __getattr__(name: str) -> Registry:
    """Load a registry of `PLACES` at its first use."""
    if name not in PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    places = (place.split(": ") for place in PLACES[name][1:])
    registry = by_name(
        getattr(import_module(f"{__name__}.{file}"), figure)
        for file, figures in places
        for figure in figures.split()
    )
    globals()[name] = registry
    return registry


def figures_of(shown: Any) -> Registry:
    """Figures that show a result, e.g. a `kolsky.inverse.result.Identification`.

    Returns: the figures by name; each has a `caption` of the result. Raises TypeError if there are no figures
    for this class.

    Examples
    --------
    >>> import kolsky
    >>> list(kolsky.figures_of(kolsky.waves("runs/bar-01")))
    ['waves']
    """
    name = f"{type(shown).__module__}.{type(shown).__qualname__}"
    if name not in SHOWN_BY:
        known = ", ".join(sorted(known.rpartition(".")[2] for known in SHOWN_BY))
        raise TypeError(f"no figure shows a {type(shown).__name__}; there are figures of {known}")
    place = SHOWN_BY[name]
    registry: Registry = globals()[place] if place in globals() else __getattr__(place)
    return registry
