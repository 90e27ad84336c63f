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
    "JOINT": ("rates.joint_shots", "rates.joint_curve"),
    # Recordings of an identification; shown after those of `REGISTRY`
    "RECORDINGS": ("recordings.raw_signals", "recordings.flyer_path", "recordings.picture_pair"),
    # Identification
    "REGISTRY": (
        "comparison.force",
        "comparison.outline",
        "comparison.profiles",
        "comparison.shape_residual",
        "misfit.likelihood",
        "misfit.ridge",
        "misfit.corner",
        "misfit.misfit",
        "comparison.energy",
        "comparison.scene",
    ),
    "SURFACES": (
        "surfaces.surface_fields",
        "surfaces.overlay_sigma",
        "surfaces.overlay_epipolar",
        "surfaces.lost_points",
        "surfaces.kymograph",
        "surfaces.flyer",
        "surfaces.flight",
        "surfaces.speckles",
    ),
    "CALIBRATION": ("calibration.calibration_residuals", "calibration.calibration_pairs"),
    # Shot before anything is run
    "CHECKS": ("recordings.checked_shot", "recordings.checked_curve"),
    # Shot whose pictures are not correlated yet
    "PICTURE_CHECKS": ("recordings.checked_pictures", "recordings.checked_curve"),
    # Test between bars before it is reduced
    "BAR_CHECKS": ("waves.checked_bars",),
    "SPECKLES": ("surfaces.speckle_floor",),
    "WAVES": ("waves.waves",),
    "FLYER_TESTS": ("waves.flyer_test",),
    "FULL_FIELDS": ("surfaces.full_field", "surfaces.histories"),
    "BARS_TOGETHER": ("waves.bars_together",),
    "REPEATS": ("waves.repeats",),
    "PLANS": ("planning.plan_information", "planning.plan_slopes", "planning.plan_choices"),
    "PREDICTIONS": ("planning.signals",),
    "SCANS": ("planning.scan",),
    "RATES": ("rates.rate_slope", "rates.rate_forest", "rates.rate_stiffness", "rates.rate_equal_strain"),
    "BASELINES": ("material.baseline",),
    "MATERIALS": ("material.material_fits", "material.material_residuals", "material.material_stability"),
    "SENSITIVITY": ("studies.sensitivity",),
    "SWEEPS": (
        "studies.sweep_maps",
        "studies.sweep_effects",
        "studies.sweep_forces",
        "studies.sweep_indices",
    ),
    "BUDGETS": ("studies.budget",),
    "MODULI": ("rates.rate_moduli",),
    "RELAXATIONS": (
        "material.relaxation_moduli",
        "material.relaxation_holds",
        "material.relaxation_oscillation",
        "material.relaxation_shifts",
    ),
    "SPECIMENS": ("bodies.forces", "bodies.correlations", "bodies.strains", "bodies.mesh"),
    "SHEETS": (
        "bodies.sheet_map",
        "bodies.sheet_histories",
        "bodies.sheet_steps",
        "bodies.sheet_fields",
    ),
    "ACTUATORS": ("bodies.shapes", "bodies.bend", "bodies.motion", "bodies.markers", "bodies.loop"),
}
"""Files and functions of the figures of each registry, in the order of its page. A file is loaded when one of
its registries is needed, because a command makes one page."""

SHOWN_BY: dict[str, str] = {
    "dic.calibration.views.Calibration": "CALIBRATION",
    "dic.chain.remarks.Speckles": "SPECKLES",
    "kolsky.bars.guides.propagation.BarsTogether": "BARS_TOGETHER",
    "kolsky.bars.reduction.repeated_tests.RepeatedTests": "REPEATS",
    "kolsky.bars.records.FlyerResult": "FLYER_TESTS",
    "kolsky.bars.records.WavesResult": "WAVES",
    "kolsky.inverse.result.Identification": "REGISTRY",
    "kolsky.inverse.joint_result.JointResult": "JOINT",
    "kolsky.studies.rate_dependence.SlowDynamics": "RELAXATIONS",
    "kolsky.material.fits.compare.Comparison": "MATERIALS",
    "kolsky.material.reference_curve.ReferenceCurve": "BASELINES",
    "kolsky.report.body_views.ActuatorView": "ACTUATORS",
    "kolsky.report.picture_views.FullFieldView": "FULL_FIELDS",
    "kolsky.report.body_views.SheetView": "SHEETS",
    "kolsky.report.body_views.SpecimenView": "SPECIMENS",
    "kolsky.report.picture_views.SurfaceView": "SURFACES",
    "kolsky.prediction.predict.Prediction": "PREDICTIONS",
    "kolsky.shot.recordings.ShotRecordings": "RECORDINGS",
    "kolsky.shot.bars.CheckedBars": "BAR_CHECKS",
    "kolsky.shot.records.PicturedShot": "PICTURE_CHECKS",
    "kolsky.shot.records.Shot": "CHECKS",
    "kolsky.studies.budget.records.Budget": "BUDGETS",
    "kolsky.studies.global_sensitivity.GlobalSensitivity": "SENSITIVITY",
    "kolsky.studies.planning.plan.Plan": "PLANS",
    "kolsky.studies.rates.records.GroupRates": "RATES",
    "kolsky.studies.sweep_analysis.SweepAnalysis": "SWEEPS",
}
"""Registries by the class of the results in their figures."""

__all__ = ["SHOWN_BY", "FigureKind", "figures_of", *PLACES]


def __getattr__(name: str) -> Registry:
    """Load a registry of `PLACES` at its first use."""
    if name not in PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    places = (place.split(".") for place in PLACES[name])
    registry = by_name(getattr(import_module(f"{__name__}.{file}"), figure) for file, figure in places)
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
